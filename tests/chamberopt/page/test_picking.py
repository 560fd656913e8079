"""Clicks on a part: faces are added and taken away, and a face is turned down."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.layout.target import surfaces
from chamberopt.chamber.part import chosen_triangles, posed_part, preview_part
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.part import Selection
from chamberopt.geometry.triangles import area_vectors, rotation_matrix
from chamberopt.page.edited_file import EditedFile
from chamberopt.page.picking import Picker
from chamberopt.page.structure import KIND, MASK_KIND, mask_kind, restructured
from tests.chamberopt.design.test_shipped_parts import PARTS
from tests.helpers.eight_parts import KEPT_ASIDE
from tests.helpers.mesh_files import write_stl
from tests.helpers.synthetic import plate_design
from tests.hunt.base import write_base

TARGET = "part.target"


class Edited:
    """A design file with changes that the page would hold."""

    def __init__(self, path: Path, changes: dict[str, Any] | None = None) -> None:
        self.file, self.changes, self.picker = (
            EditedFile(path, trusted=False),
            changes or {},
            Picker(),
        )

    @property
    def design(self) -> Design:
        return self.file.with_changes(self.changes)

    def click(
        self, triangle: int, *, add: bool = True, alike: bool = False, of: str = TARGET
    ) -> None:
        design = self.design
        self.changes |= self.picker.with_face(design, of, triangle, 30.0, alike, add)


@pytest.fixture
def gear() -> Edited:
    keys = (f"{TARGET}.{key}" for key in ("direction", "angle_deg", "box_mm"))
    return Edited(PARTS.parent / "gear.toml", dict.fromkeys(keys))


def side(design: Design) -> int:
    """A triangle of the tip of a tooth, which is as far from the axis as any."""
    mesh = preview_part(design).mesh
    middle = mesh.vertices[mesh.triangles].mean(axis=1)
    return int(np.hypot(*middle.T[:2]).argmax())


def chosen(design: Design) -> np.ndarray:
    return preview_part(design).target


def test_a_face_and_all_alike_are_added_and_taken_away(gear: Edited) -> None:
    triangle = side(gear.design)
    gear.click(triangle)
    tip = chosen(gear.design)
    assert len(gear.design.part.target.faces) == 1
    assert 0 < tip.sum() < 200
    gear.click(triangle, alike=True)
    every = chosen(gear.design)
    (row,) = gear.design.part.target.faces  # the one tip is among all that are alike
    assert row.alike
    (listed,) = gear.picker.picked(gear.design, TARGET)
    assert (listed.triangles == every).all()
    assert listed.at_mm == list(row.at_mm)
    assert every.sum() == 20 * tip.sum()
    gear.click(triangle, add=False)
    assert len(gear.design.part.target.faces) == 19
    assert (chosen(gear.design) == (every & ~tip)).all()
    part = posed_part(gear.design)[0]  # as commands choose
    assert (np.unique(part.elements[part.target]) == np.flatnonzero(chosen(gear.design)) + 1).all()


def test_what_changes_nothing_or_leaves_nothing_is_refused(gear: Edited) -> None:
    triangle = side(gear.design)
    gear.click(triangle)
    with pytest.raises(InputError, match="already in it"):
        gear.click(triangle)
    with pytest.raises(InputError, match="nothing would be left"):
        gear.click(triangle, add=False)
    with pytest.raises(InputError, match="the part has 9920"):
        gear.click(9920)
    with pytest.raises(InputError, match="not picked; allowed: "):
        gear.picker.with_face(gear.design, "zones.0.target", 0, 30.0, alike=False, add=True)


def test_a_target_chosen_by_a_direction_becomes_its_faces(tmp_path: Path) -> None:
    write_base(tmp_path)
    below = Edited(tmp_path / "design.toml")  # the face of the box that looks down
    mesh = preview_part(below.design).mesh
    top = int(area_vectors(mesh.vertices, mesh.triangles)[:, 2].argmax())
    half = Edited(tmp_path / "design.toml", {f"{TARGET}.box_mm": [[-8, -8, -9], [1, 8, 9]]})
    assert chosen(half.design).sum() == 1  # of the two triangles of the face
    with pytest.raises(InputError, match="does not follow faces at 30 degrees"):
        half.click(top)
    below.click(top)
    assert below.changes[f"{TARGET}.direction"] is None
    assert len(below.design.part.target.faces) == 2
    assert chosen(below.design).sum() == 4


def test_a_face_is_turned_down(tmp_path: Path) -> None:
    write_base(tmp_path)
    box = Edited(tmp_path / "design.toml")
    mesh = preview_part(box.design).mesh
    for triangle in range(len(mesh.triangles)):
        box.changes |= box.picker.face_down(box.design, triangle, 30.0)
        turn = preview_part(box.design).rotation
        normal = turn @ area_vectors(mesh.vertices, mesh.triangles)[triangle]
        assert normal / np.linalg.norm(normal) == pytest.approx([0, 0, -1], abs=1e-7)


def test_a_face_down_is_squared_and_the_chamber_fits(tmp_path: Path) -> None:
    """A plate of 120 x 60 x 10 mm, drawn askew, in a chamber of 40 mm that is too small for it."""
    write_base(tmp_path)
    plate = trimesh.creation.box((120, 60, 10))
    askew = rotation_matrix((20.0, 35.0, 50.0))
    write_stl(tmp_path / "box.stl", (plate.vertices @ askew.T)[plate.faces])
    whole = dict.fromkeys(f"{TARGET}.{key}" for key in ("direction", "angle_deg", "box_mm"))
    page = Edited(tmp_path / "design.toml", whole)
    broad = int((plate.face_normals[:, 2] > 0.5).argmax())
    page.changes |= page.picker.face_down(page.design, broad, 30.0)
    low, high = (end(preview_part(page.design).vertices, axis=0) for end in (np.min, np.max))
    assert 1e3 * (high - low) == pytest.approx([120, 60, 10], abs=0.3)
    assert low[:2] == pytest.approx(-high[:2], abs=1e-6)  # on the axis
    chamber = page.design.chamber
    assert chamber.diameter_mm > np.hypot(120, 60)
    assert chamber.height_mm > 1e3 * high[2] > 1e3 * low[2] > 6


def test_faces_of_holder_and_mask_are_clicked_as_those_of_the_target(gear: Edited) -> None:
    triangle = side(gear.design)
    with pytest.raises(
        InputError, match=r"holder\.at: not picked; allowed: part\.target, mask\.at"
    ):
        gear.click(triangle, of="holder.at")
    gear.changes |= restructured(gear.file.design, {}, KIND, "collar", gear.file.with_changes)
    before = chosen(gear.design)
    gear.click(triangle, of="holder.at")
    gear.click(triangle, of="mask.at", alike=True)
    design = gear.design
    assert (chosen(design) == before).all()
    assert design.holder is not None
    assert design.holder.at is not None
    assert [one.alike for one in design.holder.at.faces or ()] == [False]
    assert design.mask is not None
    assert [one.alike for one in design.mask.at.faces or ()] == [True]
    assert mask_kind(design) == "shell"
    for kind in ("plugs", "block", "shell"):
        made = restructured(gear.file.design, gear.changes, MASK_KIND, kind, gear.file.with_changes)
        assert mask_kind(gear.file.with_changes(made)) == kind
    gone = restructured(gear.file.design, gear.changes, MASK_KIND, "", gear.file.with_changes)
    assert gear.file.with_changes(gone).mask is None
    gear.changes = gone
    gear.click(triangle, of="mask.at")  # and another one after that
    assert gear.design.mask is not None


def test_a_click_takes_a_face_as_the_cad_file_has_it(tmp_path: Path) -> None:
    """The journal beside a fillet goes on into it without a crease; only the fillet is taken."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    part = KEPT_ASIDE["stepped_shaft"].write(tmp_path)
    of_part = {"part.mesh": str(part), "part.unit": "in", "part.target": {}}
    design = plate_design().changed(of_part)
    mesh = preview_part(design).mesh
    fillets = next(one for one in surfaces(mesh) if one.name.startswith("fillets"))
    first = int(np.flatnonzero(fillets.triangles)[0])
    picker = Picker()
    for border, alone in (("cad_face", True), (30.0, False)):
        row = picker.face(design, first, border, alike=False)
        assert ("cad_face" in row) is alone
        keys = Selection.model_validate({"faces": [row]})
        own = chosen_triangles(mesh, keys)
        assert bool((own & ~fillets.triangles).any()) is not alone
    changes = picker.with_face(design, TARGET, first, "cad_face", alike=False, add=True)
    assert changes[f"{TARGET}.faces"] == [picker.face(design, first, "cad_face", alike=False)]


def test_a_part_without_faces_of_its_own_is_told_so(gear: Edited) -> None:
    with pytest.raises(InputError, match="no faces of its own, as STEP has; leave cad_face out"):
        gear.picker.face(gear.design, 0, "cad_face", alike=False)
    row = {"at_mm": [0.0, 0.0, 0.0], "cad_face": True}
    design = gear.design.changed({"part.target": {"faces": [row]}})
    with pytest.raises(InputError, match=r"part\.target\.faces\.0\.cad_face: the part's file has"):
        preview_part(design)
    with pytest.raises(InputError, match="crease_deg: given beside cad_face"):
        gear.design.changed({"part.target": {"faces": [{**row, "crease_deg": 20.0}]}})


def test_a_fillet_of_facets_is_a_face_of_its_own(gear: Edited) -> None:
    """The roots of the gear's teeth, each between the file's facets on both flanks."""
    mesh = preview_part(gear.design).mesh
    roots = next(one for one in surfaces(mesh) if one.name.startswith("fillets of"))
    rows = roots.keys["faces"]
    assert [set(row) for row in rows] == [{"at_mm", "fillet"}] * 20
    chosen = chosen_triangles(mesh, Selection.model_validate(roots.keys))
    assert (chosen == roots.triangles).all()
    design = gear.design.changed({"part.target": {"faces": rows}})
    first = int(np.flatnonzero(chosen)[0])
    changes = gear.picker.with_face(design, TARGET, first, "fillet", alike=False, add=False)
    assert len(changes[f"{TARGET}.faces"]) == 19
    with pytest.raises(InputError, match=r"faces\.0\.fillet: the surface is no fillet there"):
        preview_part(
            gear.design.changed({"part.target.faces": [{**rows[0], "at_mm": [0, 12, 10]}]})
        )
    with pytest.raises(InputError, match="fillet: given beside cad_face; give one of them"):
        gear.design.changed({"part.target": {"faces": [{**rows[0], "cad_face": True}]}})
