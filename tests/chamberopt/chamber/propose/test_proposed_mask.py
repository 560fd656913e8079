"""Surfaces that must not be peened, by their names, and holes that the wall crosses."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.openings import Opening, find_walls_in_holes
from chamberopt.chamber.layout.target import RUNNING, Surface, propose_target, surfaces
from chamberopt.chamber.part import chosen_triangles
from chamberopt.chamber.propose import proposed_mask
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Wanted
from chamberopt.chamber.propose.proposed_mask import (
    NEVER,
    are_holes,
    find_left_out,
    met_beside,
    moved_openings,
    open_holes,
    pads,
    sharp_edges,
)
from chamberopt.chamber.propose.text import design_text
from chamberopt.design.part import Target
from chamberopt.geometry.meshes.part_mesh import PartMesh, read_part
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from chamberopt.geometry.triangles import areas
from tests.helpers.four_parts import FOUR_PARTS


@pytest.mark.parametrize(
    "name",
    ["BORE", "bores", "BOLT_HOLES", "hole_3", "M6 thread", "BEARING_SEAT", "keyway", "spline"],
)
def test_what_fits_to_other_parts_is_masked(name: str) -> None:
    assert NEVER.search(name)


@pytest.mark.parametrize("name", ["BASE", "wholesale", "SHANK", "boretto", "TIP", "FILLETS"])
def test_other_names_are_not(name: str) -> None:
    assert not NEVER.search(name)


@pytest.mark.parametrize(
    ("name", "runs"),
    [("PLATFORM_UNDERSIDE", True), ("dovetail", True), ("fir tree 2", True), ("journals", True),
     ("form", False), ("tree", False), ("spinner", False)],
)  # fmt: skip
def test_what_runs_or_fits_by_its_name_is_masked_too(name: str, runs: bool) -> None:
    assert (RUNNING.search(name) is not None) is runs


@pytest.mark.parametrize("unit", [1e-3, 1.0])
@pytest.mark.parametrize(("walls", "is_all"), [(20, True), (19, True), (17, False), (0, False)])
def test_a_surface_that_is_no_more_than_the_walls_of_holes_has_a_tenth_of_its_area_beside_them(
    unit: float, walls: int, is_all: bool
) -> None:
    """A strip of 30 triangles alike, of which 20 are named."""
    row = np.arange(32)
    strip = SimpleNamespace(
        vertices=unit * np.c_[row, row % 2, np.zeros(32)],
        triangles=np.c_[row, row + 1, row + 2][:30],
    )
    named, other = (Surface(name, {}, row[:30] < k, "") for name, k in (("A", 20), ("B", 30)))
    holes = [SimpleNamespace(triangles=own) for own in (row[:30] < walls, row[:30] >= 25)]
    assert are_holes(strip, [named, other], ["A"], holes) == is_all
    assert not are_holes(strip, [named, other], ["B"], holes)
    assert are_holes(strip, [named, other], [], holes)


def test_a_pad_stands_on_level_tops_beside_the_target() -> None:
    """A stair with tops of 20 x 30 and 40 x 30 mm, a wall and a target on the lower one."""
    body = trimesh.boolean.union(
        [
            trimesh.creation.box(bounds=((0, 0, 0), (60, 30, 10))),
            trimesh.creation.box(bounds=((0, 0, 0), (20, 30, 25))),
        ],
        engine="manifold",
    )
    triangles = body.faces.astype(np.int32)
    numbering = number_by_position(len(triangles))
    mesh = PartMesh(1e-3 * body.vertices, triangles, numbering, (), "", {})
    below = body.triangles_center[:, 2] < 1e-6
    both, one = pads(mesh, below, (0.0, 0.0, 0.0), 1e-3)
    assert [at["at_mm"][2] for at in both["faces"]] == [10.0, 25.0]  # the largest first
    assert one["faces"] == both["faces"][:1]
    lower = np.abs(body.triangles_center[:, 2] - 10.0) < 1e-6
    (only,) = pads(mesh, below | lower, (0.0, 0.0, 0.0), 1e-3)
    assert [at["at_mm"][2] for at in only["faces"]] == [25.0]
    assert pads(mesh, below, (30.0, 0.0, 0.0), 1e-3) == []
    assert pads(mesh, below, (0.0, 0.0, 0.0), 0.05) == []  # no ball finds room


def test_no_pad_stands_on_a_facet_along_a_round() -> None:
    """A bar of 20 mm that lies has 60 facets of 1 mm: a pad would be a needle."""
    body = trimesh.creation.cylinder(0.01, 0.06, sections=60)
    body.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 60.0, (0, 0, 1)))
    triangles = body.faces.astype(np.int32)
    mesh = PartMesh(body.vertices, triangles, number_by_position(len(triangles)), (), "", {})
    ends = np.abs(body.face_normals[:, 2]) > 0.5
    assert pads(mesh, ends, (90.0, 0.0, 0.0), 1.5e-3) == []
    assert pads(mesh, ends, (90.0, 0.0, 0.0), 0.5e-3)


def test_sharp_edges_are_those_of_the_target_that_turn_outwards() -> None:
    """A step of 8 on a base: a top of 40 x 40 mm has four outer edges, its inner ones are none."""
    base, step = trimesh.creation.box((80, 80, 8)), trimesh.creation.box((40, 40, 8))
    step.apply_translation((0.0, 0.0, 8.0))
    both = trimesh.boolean.union([base, step])
    normal = both.face_normals[:, 2]
    top = (normal > 0.9) & (both.triangles_center[:, 2] > 11.0)
    ground = (normal > 0.9) & (both.triangles_center[:, 2] < 5.0)
    for target, length in ((top, 160.0), (ground, 320.0), (top | ground, 480.0)):
        found, _ = sharp_edges(1e-3 * both.vertices, both.faces, target)
        assert found == pytest.approx(1e-3 * length)
    ball = trimesh.creation.icosphere(3)
    assert sharp_edges(ball.vertices, ball.faces, np.ones(len(ball.faces), bool))[0] == 0.0


def test_openings_that_move_in_a_second_pose_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    here = Opening("the wall", (0.02, 0.01), (0.03, 0.0, 0.015), 0.02, (1.0, 0.0, 0.0))
    up = here._replace(place=(0.03, 0.0, 0.017))
    top = here._replace(wall="the ceiling")

    def told(*poses: list[Opening]) -> str:
        monkeypatch.setattr(proposed_mask, "find_openings", lambda step: step)
        return moved_openings(SimpleNamespace(steps=poses))  # type: ignore[arg-type]

    assert told() == told([here, top], [top, here]) == ""
    assert told([here], [up]).startswith(
        "OPENINGS CHANGE in the second pose, one from 20 x 10 mm at (30, 0, 15) mm in the "
        "chamber's frame to 20 x 10 mm at (30, 0, 17) mm: a second wall"
    )
    assert " to none: " in told([here], [top])
    wider = here._replace(size=(0.02, 0.012))
    assert "to 20 x 12 mm at (30, 0, 15) mm" in told([here], [wider])


def test_a_bore_out_through_the_ceiling_is_plugged(tmp_path: Path) -> None:
    """A flange on a tube of 90 mm, open at the sonotrode and closed at its upper end."""
    flange = trimesh.creation.cylinder(18.0, 6.0, sections=48)
    tube = trimesh.creation.cylinder(10.0, 90.0, sections=48)
    tube.apply_translation((0, 0, 42.0))
    bore = trimesh.creation.cylinder(6.0, 80.0, sections=48)
    bore.apply_translation((0, 0, 30.0))
    body = trimesh.boolean.difference(
        [trimesh.boolean.union([flange, tube], engine="manifold"), bore], engine="manifold"
    )
    body.export(tmp_path / "tube.stl")
    wanted = Wanted("mm", pose="standing", ball_mm=2.0)
    made = propose(tmp_path / "tube.stl", wanted, lambda _: ["face 3"])  # the flange's underside
    assert made.design.mask is not None
    assert made.design.mask.plugs
    assert made.reasons["mask.plugs"].startswith("a plug in the hole of 12 mm, which the wall")
    assert find_walls_in_holes(made.chamber) == []
    assert open_holes(made) == ""

    bare = made.design.changed({"mask": None})
    without = replace(made, design=bare, chamber=build_chamber(bare))
    texts = [one.text for one in find_left_out(without)]
    (told,) = (one for one in texts if "THROUGH THE WALL" in one)
    assert told.startswith(
        "A HOLE THROUGH THE WALL, not plugged: the part's, of 12 mm in the ceiling at (0.0, 0.0, "
    )
    assert told.endswith("as by a pin of 12 mm in it, up to the ceiling")


def test_a_pin_bore_that_is_open_to_the_shot_is_plugged(tmp_path: Path) -> None:
    """A lug without names, of which a broad side is peened, with a bore wider than the balls."""
    lug = trimesh.creation.box((30.0, 12.0, 50.0))
    bore = trimesh.creation.cylinder(7.0, 20.0, sections=48)
    bore.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, (1, 0, 0)))
    bore.apply_translation((0, 0, -10.0))
    trimesh.boolean.difference([lug, bore], engine="manifold").export(tmp_path / "lug.stl")
    made = propose(tmp_path / "lug.stl", Wanted("mm", ball_mm=2.0), lambda _: ["face 1"])
    assert made.design.mask is not None
    assert made.design.mask.plugs
    assert made.reasons["mask.plugs"].startswith("a plug in the hole of 14 mm, open to the shot")
    assert made.chamber.fixtures["mask"].covered_target == 0.0


def test_the_face_that_goes_on_beside_a_fillet_is_met(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stud, of whose smooth side the fillet is a face of the CAD file, in a room round it."""
    angle = np.radians(np.arange(0.0, 91.0, 10.0))
    fillet = np.c_[10.0 - 4.0 * np.cos(angle), 56.0 + 4.0 * np.sin(angle)]
    profile = np.r_[[[0.0, 0.0], [6.0, 0.0]], fillet, [[16.0, 60.0], [16.0, 68.0], [0.0, 68.0]]]
    stud = trimesh.creation.revolve(profile, sections=32)
    triangles = stud.faces.astype(np.int32)
    mesh = PartMesh(1e-3 * stud.vertices, triangles, number_by_position(len(triangles)), (), "", {})
    height = stud.triangles_center[:, 2]
    radius = np.hypot(*stud.triangles_center.T[:2])
    bent = (height > 56.0) & (height < 60.0) & (radius < 10.0)
    keys = {"faces": [{"at_mm": [0.0, 0.0, 0.0], "cad_face": True}]}
    known = [Surface("fillets of 4 mm", keys, bent, ""), *surfaces(mesh)]
    monkeypatch.setattr(
        proposed_mask,
        "rows_of",
        lambda _, own: next(one.triangles for one in known if one.keys == own),
    )
    area = 1e-6 * stud.area_faces
    part = SimpleNamespace(target=bent, area=area)
    made = SimpleNamespace(
        mesh=mesh,
        design=SimpleNamespace(mask=None),
        chamber=SimpleNamespace(part=part, exposed_area=area),
        known=known,
        tables={"part.target": keys},
    )
    (met,) = met_beside(made, bent)  # type: ignore[arg-type]
    assert met.text.startswith("NOT MASKED: the shot also meets the rest of face 1 (")
    told = sum(float(one) for one in re.findall(r"([0-9]+) mm²", met.text))
    assert told == pytest.approx(1e6 * area[~bent].sum(), abs=2.0)
    assert " mm² more; what has to keep" in met.text  # one of four faces is not named
    for share, is_told in ((0.009, False), (0.011, True)):  # of the target's area, beside it
        small = np.where(bent, area, share * area * area[bent].sum() / area[~bent].sum())
        made.chamber.part.area = made.chamber.exposed_area = small
        assert bool([*met_beside(made, bent)]) == is_told  # type: ignore[arg-type]


def test_what_faces_away_is_offered_for_leaving_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The heel ends of a bevel gear's teeth face away from the sonotrode, its apex down."""
    monkeypatch.setattr("chamberopt.chamber.propose.proposed_mask.met_beside", lambda *_: [])
    monkeypatch.setattr("chamberopt.chamber.propose.proposed_mask.open_holes", lambda _: "")
    mesh = read_part(FOUR_PARTS["bevel_gear"].write(tmp_path), "mm")
    known = surfaces(mesh)
    target, area = propose_target(mesh, known, []), areas(mesh.vertices, mesh.triangles)
    heels, toes = (next(o.triangles for o in known if o.name == f"face {k}") for k in (7, 9))
    share = np.where(toes, 0.5, 1.0)
    for room in ("proposal", "proposed_mask"):
        monkeypatch.setattr(f"chamberopt.chamber.propose.{room}.touched", lambda *_: share)
    few_balls = {"": SimpleNamespace(shot=SimpleNamespace(count=100, diameter=1e-3))}
    part = SimpleNamespace(target=Target(**target.keys), rotate_deg=(0.0, 0.0, 0.0))
    posed = SimpleNamespace(
        vertices=mesh.vertices, triangles=mesh.triangles, target=target.triangles, area=area
    )
    made = SimpleNamespace(
        mesh=mesh,
        known=known,
        design=SimpleNamespace(part=part, steps=None, in_steps=few_balls),
        chamber=SimpleNamespace(part=posed, steps=()),
        tables={"part": {"mesh": str(tmp_path / "gear.obj")}, "part.target": target.keys},
        reasons={},
        trials=(),
        warnings=(),
        poses=(),
        strips=None,
    )
    away, hidden, sharp = find_left_out(made)
    assert sharp.text.startswith("SHARP EDGES")
    assert away.text == "the 12% that face away from the sonotrode (face 7)"
    assert hidden.text == "the 3% that no ball touches here (another pose may reach it)"
    text = design_text(made, tmp_path, [away, hidden])
    for line in ("direction = [0, 0, -1]", "angle_deg = [0, 105]", "reachable = true"):
        assert f"# {line}" in text
        text = text.replace(f"# {line}", line)  # as a user would
    table = tomllib.loads(text)["part"]["target"]
    left = chosen_triangles(mesh, Target.model_validate(table))
    assert (left == target.triangles & ~heels).all()
    assert table["reachable"]
