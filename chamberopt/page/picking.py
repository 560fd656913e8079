"""Turn clicks on the part into changes of a design's target, zones and pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.layout.pose import square_to_walls, turns_down
from chamberopt.chamber.layout.sizes import SHAPES, propose_sizes
from chamberopt.chamber.part import PartPreview, chosen_triangles, preview_part
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.part import MAX_FACES, FaceAt, Selection
from chamberopt.geometry.faces import Border, Faces
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.smoothing.fillets import faces_of
from chamberopt.geometry.triangles import rotation_matrix
from chamberopt.page.structure import MASK_KIND, OF_MASK, picked_surfaces

DIGITS = 4  # decimals of a place [mm]: a tenth of a micrometre
TARGET_TABLE, HOLDER_TABLE, MASK_TABLE = "part.target", "holder.at", "mask.at"
OTHER_WAYS = ("surface", "direction", "angle_deg", "box_mm", "radius_mm")
Row = dict[str, Any]  # an item of `faces` in a target's table


class Picked(NamedTuple):
    """One item of a target's table: a name of the part's file, or a face by a place on it [mm].

    Attributes:
        triangles: those of the part that it chooses, (m,) bool.
    """

    name: str
    at_mm: Sequence[float] | None
    triangles: np.ndarray


class Picker:
    """Turns clicks on the part into changes of a design.

    The part's faces are found once for each way in which they end.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[int, Border], tuple[PartMesh, Faces]] = {}

    def with_face(
        self, design: Design, table: str, triangle: int, border: Border, alike: bool, add: bool
    ) -> dict[str, object]:
        """Return changes of a design that add the face of a triangle to a target, or remove it.

        A target that the design chooses in another way, such as by a box, becomes a list of faces.

        Args:
            table: dotted name of the target, e.g. part.target.
            triangle: number of the triangle in the part's file.
            border: what ends the face: an angle between neighbouring triangles [degrees], or
                another way.
            alike: whether all congruent faces are added or removed too.
            add: whether the face is added.

        Raises:
            InputError: the target would stay as it is or be empty, or its border does not run along
                faces.
        """
        preview = preview_part(design)
        mesh, faces = preview.mesh, self.faces(preview.mesh, border)
        selection, chosen = _selection(design, table, preview)
        default = Selection()
        ways = [key for key in OTHER_WAYS if getattr(selection, key) != getattr(default, key)]
        if not ways and not selection.faces and add:  # the first face replaces the whole surface
            chosen = np.zeros_like(chosen)
        face = _face_of(faces, triangle)
        row = _row(faces, face, border, alike)
        picked = self._mask(row, mesh)
        wanted = chosen | picked if add else chosen & ~picked
        if (wanted == chosen).all():
            raise InputError(f"{table}: this face is {'already' if add else 'not'} in it")
        if not wanted.any():
            raise InputError(f"{table}: nothing would be left; add another face first")
        rows = (
            []
            if ways
            else [one.model_dump(mode="json", exclude_defaults=True) for one in selection.faces]
        )
        rows = [old for old in rows if not (add and self._within(old, mesh, picked))]
        rows = [*(old for old in rows if self._within(old, mesh, wanted)), *([row] if add else [])]
        left = wanted.copy()
        for one in rows:
            left &= ~self._mask(one, mesh)
        for lacking in np.unique(faces.of_triangle[left]):
            if not wanted[faces.of_triangle == lacking].all():
                raise InputError(
                    f"{table}: its border does not follow {_in_words(border)}; take others, or "
                    "clear it first"
                )
            rows.append(_row(faces, int(lacking), border))
        if len(rows) > MAX_FACES:
            raise InputError(f"{table}: {len(rows)} faces, more than {MAX_FACES}; take all alike")
        others: dict[str, object] = {f"{table}.{key}": None for key in ways}
        if table == TARGET_TABLE and design.part.target.cut:  # which takes a box
            others[f"{table}.cut"] = None
        if table == MASK_TABLE and design.mask is None:  # the file may have had another one
            others = {f"{table}.{key}": None for key in OTHER_WAYS}
            others |= {MASK_KIND: "shell", **{f"mask.{key}": None for key in OF_MASK}}
        return {f"{table}.faces": rows, **others}

    def picked(self, design: Design, table: str) -> list[Picked]:
        """Return the faces, or the names of the file, that a target's table lists one by one."""
        preview = preview_part(design)
        mesh, (selection, _) = preview.mesh, _selection(design, table, preview)
        if selection.faces:
            rows = [one.model_dump(mode="json", exclude_defaults=True) for one in selection.faces]
            return [Picked("", row["at_mm"], self._mask(row, mesh)) for row in rows]
        named = [one for one in selection.surface if one in mesh.groups]
        return [Picked(one, None, mesh.groups[one]) for one in named]

    def face(self, design: Design, triangle: int, border: Border, alike: bool) -> Row:
        """Return the face to which a triangle belongs, as an item of a design's list `faces`."""
        faces = self.faces(preview_part(design).mesh, border)
        return _row(faces, _face_of(faces, triangle), border, alike)

    def face_down(self, design: Design, triangle: int, border: Border) -> dict[str, object]:
        """Return changes of a design that lay a face of the part level, towards the sonotrode.

        The part is squared to the walls, and a chamber of simple form gets the sizes that `new`
        proposes for the pose.

        Args:
            triangle: number of a triangle of the face.
            border: what ends the face: an angle between neighbouring triangles [degrees], or
                another way.
        """
        preview = preview_part(design)
        mesh, faces = preview.mesh, self.faces(preview.mesh, border)
        normal = faces.normal(_face_of(faces, triangle))
        if not normal.any():
            raise InputError("this face bends all round and faces no way; click another one")
        turns = square_to_walls(mesh.vertices, turns_down(normal))
        changes: dict[str, object] = {f"part.rotate_deg.{k}": one for k, one in enumerate(turns)}
        if design.chamber.shape in SHAPES:
            posed = mesh.vertices @ rotation_matrix(turns).T
            posed[:, 2] -= posed[:, 2].min()
            top = float(posed[mesh.triangles[preview.target], 2].max())
            shape, ball = design.chamber.shape, max(design.shot.diameters)
            sizes = propose_sizes(posed, top, ball, shape, triangles=mesh.triangles)
            changes |= {f"chamber.{key}": size for key, size in sizes.lengths_mm().items()}
            changes |= {f"part.offset_mm.{k}": 0.0 for k in (0, 1) if design.part.offset[k]}
        return changes

    def faces(self, mesh: PartMesh, border: Border) -> Faces:
        """Return the part's faces that end at a border."""
        key = id(mesh), border
        if key not in self._known:
            if len(self._known) > 8:
                self._known.clear()
            faces = faces_of(mesh, border)
            self._known[key] = mesh, faces  # a mesh that is kept keeps its id
        return self._known[key][1]

    def _mask(self, row: Row, mesh: PartMesh) -> np.ndarray:
        """Return True for each triangle that an item of a design's list `faces` chooses, (m,)."""
        faces = self.faces(mesh, FaceAt.model_validate(row).border)
        face, _ = faces.at(1e-3 * np.array(row["at_mm"]))
        if row.get("alike"):
            return np.asarray(faces.alike(face)[faces.of_triangle])
        return np.asarray(faces.of_triangle == face)

    def _within(self, row: Row, mesh: PartMesh, mask: np.ndarray) -> bool:
        return not (self._mask(row, mesh) & ~mask).any()


def _selection(design: Design, table: str, preview: PartPreview) -> tuple[Selection, np.ndarray]:
    """Return the table of a target, and True for each triangle that it chooses, shape (m,).

    Args:
        table: dotted name of the target, zone or fixture, e.g. part.target.
    """
    if table not in picked_surfaces(design):
        raise InputError(f"{table}: not picked; allowed: {', '.join(picked_surfaces(design))}")
    if table == TARGET_TABLE:
        return design.part.target, preview.target
    if table in (HOLDER_TABLE, MASK_TABLE):
        fixture = design.holder if table == HOLDER_TABLE else design.mask
        if fixture is None or fixture.at is None:
            return Selection(), np.zeros_like(preview.target)
        return fixture.at, chosen_triangles(preview.mesh, fixture.at, table)
    zone = design.zones[int(table.split(".")[1])]
    return zone.target, preview.zones[zone.name]


def _face_of(faces: Faces, triangle: int) -> int:
    if not 0 <= triangle < len(faces.of_triangle):
        raise InputError(f"triangle {triangle}: the part has {len(faces.of_triangle)}")
    return int(faces.of_triangle[triangle])


def _row(faces: Faces, face: int, border: Border, alike: bool = False) -> Row:
    x, y, z = (round(1e3 * float(x), DIGITS) + 0.0 for x in faces.place(face))
    ends = {"crease_deg": border} if isinstance(border, float) else {border: True}
    made = FaceAt.model_validate({"at_mm": (x, y, z), "alike": alike, **ends})
    return made.model_dump(mode="json", exclude_defaults=True)


def _in_words(border: Border) -> str:
    return f"faces at {border:g} degrees" if isinstance(border, float) else "faces of the CAD file"
