"""A chamber that is a cylinder, box or prism is recognised; all others are refused."""

from functools import cache

import numpy as np
import pytest

from chamberopt.chamber.analytic import analytic_cavity, impacts_on_chamber
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.part import Part
from chamberopt.chamber.scene import scene_physics
from chamberopt.common.errors import InputError
from chamberopt.common.executor import local_executor
from chamberopt.design.design import validate
from chamberopt.design.load import Design, load_design
from chamberopt.simulation.evaluate import evaluate
from sim_core import ImpactLog, TriangleMesh, prism_cavity
from tests.helpers.scenes import cavities
from tests.helpers.synthetic import DESIGNS, plate_design

PLATE = plate_design()
BOX = {
    "shape": "box",
    "length_mm": 30.0,
    "width_mm": 40.0,
    "height_mm": 20.0,
    "sonotrode_distance_mm": 15.0,
}
EDGED = validate(Design, {**PLATE.model_dump(), "chamber": BOX})


@cache
def plate() -> Chamber:
    return build_chamber(PLATE)


def chamber_of(mesh: TriangleMesh) -> Chamber:
    """A chamber with the part for its ceiling."""
    source = np.where(mesh.tags == cavities.CEILING, 0, -1).astype(np.int32)
    part = Part(mesh.vertices, mesh.triangles, np.ones(1), np.ones(1, dtype=bool), "lid")
    return Chamber(
        mesh.vertices, mesh.triangles, mesh.tags, source, mesh.volume, part, np.ones(1), ()
    )


def extruded(
    outline: list[tuple[float, float]], top: float = 0.015, lean: float = 0.0
) -> TriangleMesh:
    """A room over an outline; its ceiling is ``lean`` [m] wider than its floor."""
    from shapely import Polygon
    from trimesh.creation import extrude_polygon

    body = extrude_polygon(Polygon(outline), top)
    vertices = np.asarray(body.vertices)
    vertices[vertices[:, 2] == top, 0] *= 1.0 + lean
    return cavities.tagged(vertices, np.asarray(body.faces))


def test_the_plates_chamber_is_a_true_cylinder() -> None:
    cavity = analytic_cavity(PLATE, plate())
    assert (cavity.radius, cavity.bottom) == (0.025, 0.0)
    assert cavity.top == pytest.approx(0.015, abs=1e-9)
    n = PLATE.chamber.facets
    polygon = 0.5 * n * np.sin(2.0 * np.pi / n) / np.pi
    assert plate().volume / cavity.volume == pytest.approx(polygon, rel=1e-6)


def test_a_box_and_a_prism_are_their_outlines() -> None:
    box = analytic_cavity(EDGED, chamber_of(cavities.box((0.03, 0.04, 0.02))))
    assert box.radius is None
    assert sorted(map(tuple, box.outline.tolist())) == [
        (0.0, 0.0),
        (0.0, 0.04),
        (0.03, 0.0),
        (0.03, 0.04),
    ]
    assert box.volume == pytest.approx(0.03 * 0.04 * 0.02)
    # cut in the middle of its sides, as a boolean does: the corner too many is no side
    cut = extruded([(0.0, 0.0), (0.02, 0.0), (0.04, 0.0), (0.03, 0.03), (0.01, 0.04)])
    assert len(analytic_cavity(EDGED, chamber_of(cut)).outline) == 4


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        (
            lambda: extruded(
                [(0, 0), (0.04, 0), (0.04, 0.02), (0.02, 0.02), (0.02, 0.04), (0, 0.04)]
            ),
            "not convex",
        ),
        (
            lambda: extruded([(0, 0), (0.04, 0), (0.04, 0.02), (0, 0.02)], lean=0.1),
            "wall is not upright at z",
        ),
    ],
)
def test_other_chambers_are_refused(mesh, said: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=f"not a cylinder, box or prism: .*{said}"):
        analytic_cavity(EDGED, chamber_of(mesh()))


def test_what_is_in_the_way_is_named() -> None:
    gear = load_design(DESIGNS / "gear.toml")
    with pytest.raises(InputError, match=r"the part reaches into the cavity at z = \d+"):
        analytic_cavity(gear, build_chamber(gear))
    with pytest.raises(InputError, match=r"not a circle of chamber\.diameter_mm, by 5 mm"):
        analytic_cavity(PLATE.changed({"chamber.diameter_mm": 60.0}), plate())


def test_a_part_that_turns_is_refused() -> None:
    effects = type(PLATE.effects).model_validate({"part_turn": {"rpm": 10.0}})
    with pytest.raises(
        InputError, match=r"effects\.part_turn: not supported with an analytical cavity"
    ):
        analytic_cavity(PLATE.model_copy(update={"effects": effects}), plate())


@pytest.mark.parametrize("rest", [None, False, True])
def test_balls_stand_on_nothing_but_the_sonotrode(rest: bool | None) -> None:
    """So contact mode is not simulated, whatever effects.rest says."""
    design = PLATE.changed({"effects.rest": rest})
    physics = scene_physics(design, analytic_cavity(design, plate()))
    assert physics.rest is None


def test_impacts_are_booked_on_the_triangle_under_them() -> None:
    rng = np.random.default_rng(4)
    angle, distance = 2.0 * np.pi * rng.uniform(size=500), 0.0235 * np.sqrt(rng.uniform(size=500))
    place = np.column_stack(
        [distance * np.cos(angle), distance * np.sin(angle), np.full(500, 0.0135)]
    )
    ball, speed = np.zeros(500, dtype=np.int32), np.ones(500)
    log = ImpactLog(speed, ball, np.ones(500, dtype=np.int32), place, np.zeros((500, 3)), speed)
    booked = impacts_on_chamber(log, plate()).triangle
    assert (plate().tags[booked] == 0).all()
    corners = plate().vertices[plate().triangles[booked]][:, :, :2]
    side = np.roll(corners, -1, axis=1) - corners
    to = place[:, None, :2] - corners
    within = (
        side[..., 0] * to[..., 1] - side[..., 1] * to[..., 0]
    )  # counter-clockwise from above: out of the cavity
    assert (within > -1e-12).all()


def both(design: Design) -> list[float]:
    """Differences of mean coverage and impact rate, relative to their 95 % half-widths."""
    with local_executor() as executor:
        exact = evaluate(design, plate(), executor, cavity=analytic_cavity(design, plate()))
        meshed = evaluate(design, plate(), executor)
    assert (exact.analytic, meshed.analytic) == (True, False)
    assert any("an exact cylinder of 29.452 cm³" in note for note in exact.notes)
    assert not any("analytical" in note for note in meshed.notes)
    pairs = [
        (exact.metrics[name], meshed.metrics[name])
        for name in ("mean_coverage", "impacts_per_mm2_s")
    ]
    return [(a.value - b.value) / np.hypot(a.half_width, b.half_width) for a, b in pairs]


def test_the_plate_is_peened_as_in_its_mesh() -> None:
    """Two results differ by more than twice their common half-width once in ten thousand times."""
    design = PLATE.changed(
        {"process.accuracy.replicas": 6, "process.accuracy.simulated_time_s": 1.0}
    )
    assert np.abs(both(design)).max() < 2.0


def test_a_chamber_is_filled_by_its_prism() -> None:
    """The outline goes round as prism_cavity wants it, wherever the hull begins."""
    cavity = analytic_cavity(EDGED, plate())
    again = prism_cavity(cavity.outline, 0.0, 0.015, (1, 0, 2))
    assert len(cavity.outline) == PLATE.chamber.facets
    assert again.volume == pytest.approx(plate().volume, rel=1e-6)
