"""The colours of the kinds of surfaces can be told apart, by colour-blind eyes too."""

from itertools import combinations

import numpy as np
import pytest

from chamberopt.pictures.charts.colours import (
    COUNT_MAP,
    COVERAGE_MAP,
    FEW_DENTS,
    KINDS,
    WIDTH_MAP,
    hex_colours,
    line_style,
    zone_colour,
)

# What eyes without one kind of cone see of linear RGB: Machado, Oliveira and Fernandes 2009,
# doi:10.1109/TVCG.2009.113, table 1 at severity 1.
EYES = {
    "usual": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
# Linear sRGB to CIE XYZ under D65: IEC 61966-2-1.
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.072175],
        [0.0193339, 0.119192, 0.9503041],
    ]
)
LEAST = 18.0  # CIE 1976 difference; about 2.3 can just be seen side by side


def lab(colour: str, eye: str) -> np.ndarray:
    """CIE L*a*b* of a colour #rrggbb as an eye sees it."""
    level = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    share = XYZ @ np.clip(np.asarray(EYES[eye]) @ linear, 0.0, 1.0) / XYZ.sum(axis=1)
    x, y, z = np.where(share > 216 / 24389, np.cbrt(share), (24389 / 27 * share + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_the_difference_is_that_of_the_standard() -> None:
    assert lab("#ffffff", "usual") == pytest.approx([100, 0, 0], abs=1e-3)
    assert lab("#ff0000", "usual") == pytest.approx([53.24, 80.09, 67.20], abs=0.02)


@pytest.mark.parametrize("eye", EYES)
def test_any_two_kinds_can_be_told_apart(eye: str) -> None:
    seen = {name: lab(kind.colour, eye) for name, kind in KINDS.items()}
    near = min(combinations(seen, 2), key=lambda two: np.linalg.norm(seen[two[0]] - seen[two[1]]))
    assert np.linalg.norm(seen[near[0]] - seen[near[1]]) > LEAST, near


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("scale", [COVERAGE_MAP, COUNT_MAP, WIDTH_MAP])
def test_too_few_dents_are_not_taken_for_a_value(scale: str, eye: str) -> None:
    few = lab(FEW_DENTS, eye)
    assert all(np.linalg.norm(few - lab(one, eye)) > LEAST for one in hex_colours(scale, 50))


def test_the_first_eight_results_and_five_zones_look_different() -> None:
    styles = [line_style(k) for k in range(8)]
    assert (
        len({str(one["color"]) for one in styles}) == len({str(one["ls"]) for one in styles}) == 8
    )
    assert line_style(8) == styles[0]
    assert len({zone_colour(k) for k in range(5)}) == 5
    assert zone_colour(7) == zone_colour(2)


def test_colours_of_a_map_go_from_end_to_end() -> None:
    assert hex_colours("gray", 3) == ["#000000", "#808080", "#ffffff"]
    assert len(hex_colours("gray")) == 10
