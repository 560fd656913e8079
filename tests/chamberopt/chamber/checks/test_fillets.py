"""Fillets and slots that are small for the shot."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import shot_reach
from chamberopt.chamber.checks.fillets import (
    InnerEdges,
    facet_warnings,
    fillet_warnings,
    inner_edges,
    radii_of_target,
    too_narrow,
)
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.design.load import load_design
from tests.helpers.synthetic import DESIGNS, chamber_round

SIDES = 48


def test_the_radius_of_a_bore_follows_from_its_facets() -> None:
    """Facets between points of a circle of 5 mm touch one of 5 mm times cos(pi / SIDES)."""
    ring = trimesh.creation.annulus(r_min=5e-3, r_max=9e-3, height=4e-3, sections=SIDES)
    every = np.ones(len(ring.faces), dtype=bool)
    _, length, radius, *_ = inner_edges(ring.vertices, ring.faces, every)
    assert len(radius) == SIDES
    assert length == pytest.approx(4e-3)
    assert radius == pytest.approx(5e-3 * np.cos(np.pi / SIDES))


def test_no_fillets_are_found_on_a_shaft_whose_triangles_are_not_even() -> None:
    """At many of its edges triangles turn inwards; inside out it is a bore, and counts."""
    rng = np.random.default_rng(1)
    around, along = np.meshgrid(np.arange(40.0), np.arange(40.0))
    flat = np.stack([around, along], axis=-1).reshape(-1, 2) + rng.uniform(-0.3, 0.3, (1600, 2))
    angle = 2.0 * np.pi / 45.0 * flat[:, 0]
    places = np.stack([5e-3 * np.cos(angle), 5e-3 * np.sin(angle), 7e-4 * flat[:, 1]], axis=-1)
    triangles = Delaunay(flat).simplices
    every = np.ones(len(triangles), dtype=bool)
    length = inner_edges(places, triangles, every).length
    assert length.sum() < 2e-3  # of 2 m: what is shorter than a ball is not told
    length = inner_edges(places, triangles[:, ::-1], every).length
    assert length.sum() > 1.0


def warned(mesh: trimesh.Trimesh, ball: float) -> list[DesignWarning]:
    chamber = chamber_round(mesh)
    shot = SimpleNamespace(diameters=(ball,), diameter=ball)
    reach = shot_reach(SimpleNamespace(shot=shot), chamber)
    return fillet_warnings(reach, chamber, ball)


def test_shot_of_more_than_half_a_fillet_or_a_quarter_of_a_slot_is_warned_of() -> None:
    """An L has an inner edge without a fillet; a U of 6 mm is a slot for balls above 1.5 mm."""
    foot = trimesh.creation.box(bounds=[[0, 0, 0], [0.03, 0.02, 0.003]])
    wall = trimesh.creation.box(bounds=[[0, 0, 0.0], [0.003, 0.02, 0.02]])
    other = trimesh.creation.box(bounds=[[0.009, 0, 0.0], [0.012, 0.02, 0.02]])
    corner = trimesh.boolean.union([foot, wall], engine="manifold")
    (said,) = warned(corner, 1e-3)
    assert said.kind is WarningKind.FILLET
    assert "half the radius of the target's smallest fillets (inner edges without one" in said.text
    assert warned(foot, 1e-3) == []
    slot = trimesh.boolean.union([corner, other], engine="manifold")
    assert [one for one in warned(slot, 1.4e-3) if one.kind is WarningKind.SLOT] == []
    (said,) = (one for one in warned(slot, 1.6e-3) if one.kind is WarningKind.SLOT)
    assert "quarter of the target's narrowest slot, about 6.01 mm wide" in said.text  # 6 by design


@pytest.mark.parametrize(
    ("turn", "reachable", "told"),
    [
        (16.0, 1.0, None),
        (16.0, 0.9996, None),
        (30.0, 1.0, "they look up to 15 degrees aside of a round"),
        (16.0, 0.93, "touches 93.0% of the target, by the curvature of its rounds up to 100.0%"),
    ],
)
def test_facets_are_warned_of_where_they_tell_of_the_coverage(
    turn: float, reachable: float, told: str | None
) -> None:
    facts = SimpleNamespace(
        coarse_turn=np.radians(turn), coarse_share=0.25, noisy_share=0.0, crossing_share=0.0
    )
    part = SimpleNamespace(smoothing=facts, hollow=None)
    warned = facet_warnings(part, 1e-3, reachable)  # type: ignore[arg-type]
    assert [told is not None and told in one.text for one in warned] == [True] * (told is not None)


@pytest.mark.parametrize("larger", [1.0, 4.0])
@pytest.mark.parametrize(
    ("curl_mm2", "others", "counts"),
    [
        (0.34, 2.0, False),  # at the trailing edge of a vane, of 217 mm²
        (10.0, 2.0, True),
        (0.34, 100.0, True),  # beside a wide hollow alone it is a fillet of its own
        (0.34, 0.0, True),  # beside no other fillet too
    ],
)
def test_a_curl_at_the_end_of_a_fillet_does_not_count(
    curl_mm2: float, others: float, counts: bool, larger: float
) -> None:
    """An edge with a radius of 0.5 mm beside others of some mm, for balls of 0.8 mm."""
    radius = 1e-3 * larger * np.array([0.5, others])
    area = 1e-6 * larger**2 * np.array([0.5 * curl_mm2, 0.5 * curl_mm2, 109.0, 108.0])
    edges = InnerEdges(
        np.zeros((2, 3)), np.ones(2), radius, np.arange(4).reshape(2, 2), np.ones((2, 2), bool)
    )
    small = too_narrow(edges, area, 0.8e-3 * larger)
    assert small.tolist() == [counts, others == 0.0]
    # An inner edge without a fillet always counts.
    bare = edges._replace(radius=np.zeros(2))
    assert too_narrow(bare, area, 0.8e-3 * larger).all()


@pytest.mark.parametrize("radius_mm", [2.0, 5.0])
def test_the_radius_of_a_fillet_that_is_the_target(tmp_path: Path, radius_mm: float) -> None:
    """Of a hub on a plate, chosen as a fillet; by an angle of facets no radius is told."""
    angle = np.radians(np.linspace(180.0, 270.0, 13))
    round_ = np.c_[np.cos(angle), np.sin(angle)] * radius_mm + (15.0 + radius_mm, 8.0 + radius_mm)
    profile = [(0, 0), (40, 0), (40, 8), *round_[::-1], (15, 40), (0, 40)]
    trimesh.creation.revolve(profile, sections=72).export(tmp_path / "hub.stl")
    middle = 15.0 + radius_mm * (1.0 - np.sqrt(0.5))
    place = [middle, 0.0, 8.0 + radius_mm * (1.0 - np.sqrt(0.5))]
    for key, found in (("fillet", [1e-3 * radius_mm]), ("alike", [])):
        values = {
            "part": {"mesh": str(tmp_path / "hub.stl"), "unit": "mm"}
            | {"target": {"faces": [{"at_mm": place, key: True}]}},
            "chamber": {"shape": "cylinder", "diameter_mm": 120, "height_mm": 80}
            | {"sonotrode_distance_mm": 20},
        }
        design = load_design(DESIGNS / "plate.toml").changed(values)
        part = build_chamber(design).part
        assert radii_of_target(design, part) == pytest.approx(found, rel=0.02)
