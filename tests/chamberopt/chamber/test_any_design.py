"""Whatever the numbers of a design are: its cavity is closed and holds the shot, or it is refused.

Refused means by an InputError that names a key of the design.
"""

from __future__ import annotations

import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from hypothesis import HealthCheck, event, example, given, settings
from hypothesis import strategies as st

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from tests.helpers.synthetic import plate_design

KEY = re.compile(r"\b(part|chamber|sonotrode|shot|materials|process|effects)\.\w+|\bshot: ")
PLATE = plate_design().model_dump(mode="json", exclude_none=True)
FEW_BALLS = 3000  # a larger shot packs as slowly as it is large


# Usual designs. Each of their floats is drawn near its own, and now and then one far from it.
LEANS, HEIGHT = {"inclination_deg": 2.0}, {"height_mm": 20.0}
CHAMBERS: dict[str, dict[str, Any]] = {
    "cylinder": {"diameter_mm": 50.0, "corner_radius_mm": 1.0} | HEIGHT | LEANS,
    "box": {"length_mm": 50.0, "width_mm": 50.0} | HEIGHT | LEANS,
    "prism": {"across_mm": 50.0, "turn_deg": 10.0} | HEIGHT | LEANS,
    "revolve": {"profile_mm": [[25.0, 0], [27.0, 8.0], [24.0, 20.0]], "corner_radius_mm": 0.5}
    | LEANS,
    "conformal": {"outline": "hull", "gap_mm": 8.0} | HEIGHT | LEANS,
    "conformal, upright": {"outline": "silhouette", "gap_mm": 8.0} | HEIGHT,
}  # fmt: skip
DEFLECTOR = {"kind": "rod", "at_mm": [18.0, 2.0, 8.0], "rotate_deg": [90.0, 5.0, 0.0],
             "diameter_mm": 3.0, "length_mm": 12.0}  # fmt: skip
HOLE = {"at_mm": [1.0, 1.0, 12.0], "axis": [1.0, 0.2, 0.1], "diameter_mm": 5.0, "depth_mm": 4.0}
LAWS = (  # of restitution
    {"C0": 0.9, "v0_m_s": 0.4},
    {"C0": 0.9, "v0_m_s": 0.4, "exponent": 0.2},
    {"C0": 0.9, "exponent": 0.0},
    {"e_at_m_s": [[0.0, 1.0], [0.5, 0.8], [5.0, 0.4]]},
)
FAR = (0.0, -1.0, 1e-6, 0.05, 0.3, 3.0, 10.0, 1e6)  # in usual numbers


@st.composite
def tables(draw: st.DrawFn) -> dict[str, Any]:
    table, shape = deepcopy(PLATE), draw(st.sampled_from(sorted(CHAMBERS)))
    sides = {"sides": draw(st.integers(2, 70))} if shape == "prism" else {}
    own = {"shape": shape.partition(",")[0], "sonotrode_distance_mm": 15.0, **CHAMBERS[shape]}
    table["chamber"] = deepcopy(own) | sides
    for name, one in (("deflectors", DEFLECTOR), ("holes", HOLE)):
        if draw(st.integers(0, 3)) == 3:
            table["chamber"][name] = [deepcopy(one)]
    table["part"] |= {"offset_mm": [2.0, 2.0], "rotate_deg": [3.0, 3.0, 3.0]}
    table["shot"] |= {"mass_g": 3.3, "diameter_mm": 3.0}
    table["sonotrode"]["amplitude_um"] = 25.0
    for surface in ("shot", "wall", "sonotrode"):
        table["materials"][surface] = deepcopy(draw(st.sampled_from(LAWS)))
    yields = {"v0_m_s": 0.2, "hardness_HB": 120.0}
    table["materials"]["part"] = deepcopy(draw(st.sampled_from(LAWS))) | yields
    pose = {name: table["part"][name] for name in ("offset_mm", "rotate_deg")}
    drawn = (table["chamber"], pose, table["shot"], table["sonotrode"])
    leaves = [leaf for part_of_it in drawn for leaf in floats(part_of_it)]
    for place, key in leaves:
        place[key] *= draw(st.floats(0.8, 1.25))
    leaves += floats(table["materials"])
    for place, key in draw(st.lists(st.sampled_from(leaves), max_size=2)):
        place[key] *= draw(st.sampled_from(FAR))
    return table


def floats(values: Any) -> list[tuple[Any, Any]]:
    """(table or list, key) of every float in nested ones."""
    found = []
    for key, one in values.items() if isinstance(values, dict) else enumerate(values):
        if isinstance(one, float):
            found.append((values, key))
        elif isinstance(one, (dict, list)):
            found += floats(one)
    return found


def is_closed(triangles: np.ndarray) -> bool:
    """Whether every edge belongs to as many triangles one way round as the other."""
    sides = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    one, other = (np.sort(sides @ np.array(way)) for way in ([1 << 32, 1], [1, 1 << 32]))
    return np.array_equal(one, other)


def winding_numbers(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """How often a surface goes round each place: 1 inside.

    Source: A. Van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    found = []
    for place in places:
        a, b, c = np.moveaxis(corners - place, 1, 0)
        la, lb, lc = (np.linalg.norm(one, axis=1) for one in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        rest = la * lb * lc + lc * (a * b).sum(1) + lb * (a * c).sum(1) + la * (b * c).sum(1)
        found.append(np.arctan2(volume, rest).sum() / (2.0 * np.pi))
    return np.array(found)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@example(PLATE)
@example(
    PLATE
    | {"part": PLATE["part"] | {"offset_mm": [1e12, 0.0]}}
    | {"chamber": {"shape": "conformal", "sonotrode_distance_mm": 15.0, "outline": "hull"}
       | {"gap_mm": 8.0, "height_mm": 20.0}}
)  # fmt: skip
@given(tables())
def test_a_cavity_is_closed_and_holds_the_shot_or_is_refused(table: dict[str, Any]) -> None:
    refused = ""
    try:
        design = validate(Design, table, Path("design.toml"))
        chamber = build_chamber(design)
        if design.shot.count > FEW_BALLS:
            return
        scene = build_scene(design, chamber_mesh(chamber), 1, turning_axis(design, chamber.part))
    except InputError as error:
        refused = str(error)
    event(f"{'refused' if refused else 'accepted'} {table['chamber']['shape']}")
    if refused:
        assert KEY.search(refused), refused
        return
    assert is_closed(chamber.triangles)
    corners = chamber.vertices[chamber.triangles]
    assert trimesh.triangles.mass_properties(corners).volume > 0.0
    assert np.isclose(abs(trimesh.triangles.mass_properties(corners).volume), chamber.volume)
    some = scene.balls.positions[:: max(1, len(scene.balls.positions) // 20)]
    assert np.allclose(winding_numbers(corners, some), 1.0, atol=1e-6)
