"""Propose the surface of a part to peen.

It is chosen from names in the part's file and from faces between sharp edges.
"""

from __future__ import annotations

import colorsys
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from chamberopt.chamber.matters import MatterKind
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.geometry.face_shapes import (
    PATTERN,
    find_bevels,
    is_inside_of_tube,
    is_ring,
    leg_of_bevel,
    teeth_of,
)
from chamberopt.geometry.meshes.part_mesh import PartMesh, select_triangles
from chamberopt.geometry.smoothing.fillets import faces_of, fillets_of
from chamberopt.geometry.triangles import areas, border_edges, centre_of_mass

TOLD = 0.5  # share of a surface that others named tell of, from which on it is not named
CREASE_DEG = 30.0
WHOLE_PART = 0.99  # share of the area from which a named surface counts as the whole part
RUNNERS_UP = 2  # that a reason names
MOST_SINGLE = 4  # faces alike that are listed one by one
SINGLE = re.compile(r"(face \d+)\.(\d+)", re.I)
MAX_KINDS = 40  # kinds of faces that are listed, the largest areas first
FOR = "(?:peen|target|(?:ge)?strahl|grenaill)"
MEANT = re.compile(FOR, re.I)  # names that say that a surface is to be peened
NOT, GAP = "un|not?|non|without|kein|keine|nicht|ohne|sans|pas", r"[\s_-]"
# Names of surfaces to leave out: unpeened, DO_NOT_PEEN, nicht zu strahlen, mask.
LEFT_OUT = re.compile(rf"(?<![a-z])(?:(?:{NOT})(?:{GAP}+.*)?{FOR}|mask|abdeck)", re.I)
# Names of what is left when the surfaces of interest are named.
REST = re.compile(r"^(?:the[\s_-]+)?(?:rest|others?|remain\w*|default|body|bulk)(?![a-z])", re.I)
# Names of what is usually peened, the likeliest first: what raises stress, the surfaces that work,
# and last roots, which of a gear are its fillets, but of a blade what holds it.
USUAL = (
    "fillet|weld|notch|groove|slot|fir.?tree|dove.?tail|kehle|schwei(?:ss|ß)naht",
    "flank|tooth|teeth|zahn|air?foil|aerofoil|suction|pressure|blade|vane|pin|journal|coil|shank|"
    "spoke|neck|race|zapfen|schaufel",
    "root|radi(?:us|i)",
)
USUALLY = tuple(re.compile(rf"(?<![a-z])(?:{one})s?(?![a-z])", re.I) for one in USUAL)
# Names of what usually holds the part, or is machined after it was peened.
SELDOM = re.compile(
    r"(?<![a-z])(?:base|bottom|end|hub|(?:bolt.?)?hole|bore|mount(?:ing)?|flange|foot|clamp|"
    r"fixture|seat|tip|leg|thread)s?(?![a-z])",
    re.I,
)
# Names of what runs in bearings or fits others: where they are no target, its size and finish must
# stay.
RUNNING = re.compile(
    r"(?<![a-z])(?:pin|journal|race|bearing|zapfen|platform|dove.?tail|fir.?tree)s?(?![a-z])", re.I
)
CONFIRM = "confirm that it is what fails in use (choose another: --target)"
BY_SIZE, BY_SHAPE = f"{MatterKind.BY_SIZE}: {CONFIRM}", f"{MatterKind.BY_SHAPE}: {CONFIRM}"
AS_LARGE = 0.9  # of the largest face's area: the target takes a face as large, e.g. a blade's back
LARGE_PATTERN = 0.1  # least share of the part's area of faces that repeat, such as those of teeth
SHARPER_DEG = 45.0, 60.0  # of edges, where those of CREASE_DEG part a coarse mesh into facets
COLOUR, VIVID = re.compile(r"#([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$", re.I), 100
BY_PROGRAM = re.compile(r"(?:created|exported|generated|written)[\s_-]+(?:by|from|with)\b", re.I)
NUMBERED = re.compile(r"(?:pid|set|zone)[\s_]*\d+$", re.I)  # names that say nothing
MOST_BESIDE_MM = 2.0  # of what goes on from a fillet, by heart: as wide as its radius below that
FACE = re.compile(r"face (\d+)", re.I)
FLAT_DEG = 5.0  # largest angle in a face that is flat
AROUND = 0.1  # share of the fillets' area from which on a face is one in which they lie
SAME_RADIUS = 0.05  # relative difference of radii below which fillets are of one radius
MOST_NAMED = 5  # surfaces of a target that are named; of more, the first are
Keys = dict[str, Any]
"""Keys of [part.target], "surface" or "faces", and their values."""

WHOLE: Keys = {"surface": ["all"]}
BEVELS = "bevels"  # name of the surface of all bevels in hollow corners, which are fillet welds


@dataclass(frozen=True)
class Surface:
    """A surface that can be the target: named by the file, or a face with all faces like it."""

    name: str  # value for --target
    keys: Keys
    triangles: np.ndarray  # (m,) bool
    text: str  # description in a few words
    colour: str = ""  # colour of just these triangles in the file
    alone: str = ""  # names of each of its faces, and where they look, if they are few
    raises_stress: bool = False  # whether such a form raises stress, as fillets and welds do
    beside_mm: float = 0.0  # what a target of it takes of the faces that go on from it

    @property
    def are_alike(self) -> bool:
        """Whether it is several faces that are alike."""
        return any(key.get("alike") for key in self.keys.get("faces", ()))


@dataclass(frozen=True)
class Target:
    """The proposed surface to peen, and the reason for it."""

    keys: Keys
    triangles: np.ndarray  # (m,) bool
    reason: str
    # Fillets that were chosen by their shape, of which it is made: some of them may be left out.
    fillets: tuple[Surface, ...] = ()


def surfaces(mesh: PartMesh) -> list[Surface]:
    """Return all surfaces that the target can be chosen from.

    First are the surfaces that the file names, then fillets, bevels and faces, each the largest
    first.
    """
    return [*named_surfaces(mesh), *_fillets(mesh), *_bevels(mesh), *_faces(mesh)]


def named_surfaces(mesh: PartMesh) -> list[Surface]:
    """Return the surfaces that a part's file names, the largest first.

    Of several names of the same triangles the plainest is taken, a colour or a number last.
    """
    area = areas(mesh.vertices, mesh.triangles)
    named: dict[bytes, Surface] = {}

    def plainness(one: tuple[str, np.ndarray]) -> tuple[bool, bool, int]:
        return COLOUR.match(one[0]) is not None, NUMBERED.match(one[0]) is not None, len(one[0])

    for name, marked in sorted(mesh.groups.items(), key=plainness):
        if BY_PROGRAM.match(name):  # names a program, and no surface
            continue
        same = named.get(marked.tobytes())
        colour = name if COLOUR.match(name) else ""
        if same is not None:
            named[marked.tobytes()] = replace(same, colour=same.colour or colour)
        elif marked.any():
            named[marked.tobytes()] = replace(_named(mesh, name, marked), colour=colour)
    return sorted(named.values(), key=lambda one: -area[one.triangles].sum())


def propose_target(mesh: PartMesh, known: Sequence[Surface], wanted: Iterable[str]) -> Target:
    """Return the target made of the wanted surfaces, or the likeliest target if none is wanted.

    Raises:
        InputError: there is no surface of that name.
    """
    chosen = {one.name: one for one in (find_surface(mesh, known, name) for name in wanted)}
    if chosen:
        whole = [one for one in chosen.values() if one.keys == WHOLE and one.triangles.all()]
        return _joined(whole or list(chosen.values()), "as asked (--target)")
    named, faces = (
        [one for one in known if ("surface" in one.keys) is kind] for kind in (True, False)
    )
    named = [one for one in named if not LEFT_OUT.search(one.name)]
    if meant := [one for one in named if MEANT.search(one.name)]:
        return _joined(meant, "the name says what it is for")
    marked = [one for one in named if _is_vivid(one.colour) and not one.triangles.all()]
    if marked:
        best = min(marked, key=lambda one: _from_red(one.colour))
        several = ", the reddest of several" if len(marked) > 1 else ""
        return _joined([best], f"its colour {best.colour} marks it{several}")
    area = areas(mesh.vertices, mesh.triangles)

    def beside(others: Sequence[Surface]) -> str:
        texts = [f"{one.name} ({one.text})" for one in others[:RUNNERS_UP]]
        return f"; after it {' and '.join(texts)}" if texts else ""

    def by_size(text: str, others: Sequence[Surface]) -> str:
        return f"{text}{beside(others)}; {BY_SIZE}"

    special = [
        one
        for one in named
        if area[one.triangles].sum() < WHOLE_PART * area.sum()
        and not REST.match(one.name)
        and len(border_edges(mesh.triangles[one.triangles]))  # a whole body has no border
    ]
    for usual in USUALLY:
        if likely := [one for one in special if usual.search(one.name)]:
            rest = [one for one in special if one not in likely]
            return _joined(likely, "by its name, as such are usually peened" + beside(rest))
    if special:
        special.sort(key=lambda one: SELDOM.search(one.name) is not None)
        return _joined(special[:1], by_size("the largest surface that the file names", special[1:]))
    fillets = [one for one in faces if one.raises_stress]
    faces = [one for one in faces if not one.raises_stress]
    repeated = [one for one in faces if one.keys["faces"][0].get("alike")]
    counts = {one.name: _count(one) for one in repeated}
    features = [
        one for one in repeated if counts[one.name] >= PATTERN and _stand_in_ring(mesh, one)
    ]
    patterns: list[tuple[list[Surface], str]] = []
    if features:
        best = max(features, key=lambda one: float(area[one.triangles].sum()))
        fits = {counts[best.name] * k // 2 for k in (1, 2, 4)}
        pattern = [one for one in features if counts[one.name] in fits]
        patterns.append((pattern, "faces that repeat round the part, such as those of teeth"))
    own = mesh.triangles
    single = [
        (one, teeth_of(mesh.vertices, own[one.triangles])) for one in faces if one not in repeated
    ]
    patterns += [
        ([one], f"it repeats {teeth} times round an axis, as teeth do")
        for one, teeth in single
        if teeth >= PATTERN
    ]
    sizes = [sum(float(area[x.triangles].sum()) for x in pattern) for pattern, _ in patterns]
    if max(sizes, default=0.0) >= LARGE_PATTERN * area.sum():
        pattern, text = patterns[int(np.argmax(sizes))]
        others = [one for one in faces if one not in pattern]
        return _joined(pattern, f"{text}{beside(others)}; {BY_SHAPE}")
    if fillets:
        text = f"by their shape, as such are usually peened{beside(faces)}"
        text += f"{_around(fillets, faces, area)}; {BY_SHAPE}"
        return replace(_joined(fillets, text), fillets=tuple(fillets))
    sizes = [area[one.triangles].sum() for one in faces]
    large = [one for one, size in zip(faces, sizes, strict=True) if size >= AS_LARGE * sizes[0]]
    # Beside the sides of a blade, those of its root are as large, but flat.
    large = [
        one
        for one in large
        if one is large[0]
        or (
            not is_inside_of_tube(mesh.vertices, own[one.triangles])
            and (not _is_flat(mesh, one) or _is_flat(mesh, large[0]))
        )
    ]
    others = [one for one in faces if one not in large]
    return _joined(large, by_size("the largest between sharp edges", others))


def _around(fillets: Sequence[Surface], faces: Sequence[Surface], area: np.ndarray) -> str:
    """Return words for the faces that go on smoothly from some fillets, if they are much larger.

    Args:
        faces: faces between sharp edges.
        area: of the part's triangles [m²], (m,).
    """
    own = np.any([one.triangles for one in fillets], axis=0)
    size = float(area[own].sum())
    beside = [one for one in faces if area[own & one.triangles].sum() > AROUND * size]
    if not beside or sum(area[one.triangles].sum() for one in beside) < 2.0 * size:
        return ""
    asked = " ".join(f'--target "{one.name}"' for one in beside[:MOST_NAMED])
    return f"; with all of the surfaces that they lie in: {asked}"


def fewer_fillets(mesh: PartMesh, target: Target) -> list[Target]:
    """Return the targets that leave out fillets near the heavier end of a part, the fewest first.

    So that end may be held. There are none of a target that is not fillets chosen by their shape.
    """
    axis = int(np.ptp(mesh.vertices, axis=0).argmax())
    own, area = mesh.vertices[:, axis], areas(mesh.vertices, mesh.triangles)
    heavy = float(centre_of_mass(mesh.vertices, mesh.triangles)[axis])
    way = 1.0 if heavy > 0.5 * float(own.min() + own.max()) else -1.0
    middle = way * own[mesh.triangles].mean(axis=1)
    nearest = sorted(
        target.fillets,
        key=lambda one: -float(np.average(middle[one.triangles], weights=area[one.triangles])),
    )
    found = []
    for number in range(1, len(nearest)):
        without, left = nearest[:number], nearest[number:]
        asked = " ".join(f'--target "{one.name}"' for one in without)
        these = ", ".join(f"{one.name} ({one.text})" for one in without)
        text = (
            "by their shape, as such are usually peened, and so that an end is free to hold it by; "
            f"{MatterKind.FILLETS_LEFT}, {these}: give them a design of their own, by {asked}; "
            f"{BY_SHAPE}"
        )
        found.append(_joined(left, text))
    return found


def crease_deg(mesh: PartMesh) -> float:
    """Return the angle of the edges between the faces of a part [degrees]: CREASE_DEG or sharper.

    It is the least at which few of the faces are facets; the sharpest if none is.
    """
    tried = CREASE_DEG, *SHARPER_DEG
    return next((one for one in tried if not mesh.faces(one).are_facets.any()), tried[-1])


def why_unnamed(mesh: PartMesh) -> str:
    """Return why some of a part's faces are in no surface of `surfaces`, in words."""
    if mesh.faces(crease_deg(mesh)).are_facets.any():
        return "it is a facet: the triangles of the file are too coarse for faces"
    return f"only the {MAX_KINDS} largest kinds of faces are named"


def _stand_in_ring(mesh: PartMesh, alike: Surface) -> bool:
    """Return whether faces that are alike stand evenly round an axis."""
    return is_ring(mesh.faces(crease_deg(mesh)), mesh.vertices, mesh.triangles, alike.triangles)


def _is_flat(mesh: PartMesh, one: Surface) -> bool:
    """Return whether the faces of a surface are flat."""
    faces = mesh.faces(crease_deg(mesh))
    return bool(faces.are_flat(FLAT_DEG)[faces.of_triangle[one.triangles]].all())


def _faces(mesh: PartMesh) -> list[Surface]:
    """Return the faces between sharp edges, the largest first, as surfaces.

    Faces that are alike are one surface. Facets of a mesh that is too coarse are left out.
    """
    crease = crease_deg(mesh)
    faces = mesh.faces(crease)
    left, found = ~faces.are_facets, []
    for face in np.argsort(-faces.area, kind="stable"):
        if left[face]:
            same = faces.alike(face) & left
            left &= ~same
            found.append((float(faces.area[same].sum()), int(face), same))
    found.sort(key=lambda one: -one[0])
    listed = []
    taken = {name.lower() for name in mesh.groups}  # a name of the file goes first
    free = (name for number in count(1) if (name := f"face {number}") not in taken)
    for (area, face, same), name in zip(found[:MAX_KINDS], free, strict=False):
        key: dict[str, object] = {"at_mm": faces.place_mm(face), "crease_deg": crease}
        several = int(same.sum())
        if several > 1:
            key["alike"] = True
        marked = same[faces.of_triangle]
        text = (
            f"{several} faces alike, {area_in_mm2(area)} in all"
            if several > 1
            else area_in_mm2(area)
        )
        singles = np.flatnonzero(same) if 1 < several <= MOST_SINGLE else ()
        alone = ", ".join(
            f"{name}.{k} looks {_way(faces.normal(int(one)))}"
            for k, one in enumerate(singles, start=1)
        )
        listed.append(Surface(name, {"faces": [key]}, marked, text, alone=alone))
    return listed


def _fillets(mesh: PartMesh) -> list[Surface]:
    """Return the fillets of a part, those of one radius as one surface, by their area."""
    fillets, faces = fillets_of(mesh), faces_of(mesh, "fillet")
    first = [np.flatnonzero(fillets.of_triangle == k)[0] for k in range(len(fillets.curvature))]
    left, bent, found = faces.of_triangle[first], fillets.curvature, []
    own_key = "fillet" if mesh.numbering.cad_face is None else "cad_face"
    while len(left):
        widest = bent[faces.area[left].argmax()]
        is_alike = np.abs(bent / widest - 1.0) < SAME_RADIUS
        own, left, bent = left[is_alike], left[~is_alike], bent[~is_alike]
        area = float(faces.area[own].sum())
        keys = [{"at_mm": faces.place_mm(int(k)), own_key: True} for k in own]
        count = f"{len(own)} faces, " if len(own) > 1 else ""
        name, marked = f"fillets of {1e3 / widest:.3g} mm", np.isin(faces.of_triangle, own)
        text = count + area_in_mm2(area)
        beside_mm = min(max(0.5 * round(2e3 / widest), 0.5), MOST_BESIDE_MM)
        one = Surface(name, {"faces": keys}, marked, text, raises_stress=True, beside_mm=beside_mm)
        found.append((area, one))
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])]


def _bevels(mesh: PartMesh) -> list[Surface]:
    """Return the bevels in hollow corners of a part, such as fillet welds, as one surface."""
    crease = crease_deg(mesh)
    faces = mesh.faces(crease)
    own = find_bevels(faces, mesh.vertices, mesh.triangles)
    if not len(own):
        return []
    keys = [{"at_mm": faces.place_mm(int(k)), "crease_deg": crease} for k in own]
    count = f"{len(own)} faces, " if len(own) > 1 else ""
    text = f"{count}{area_in_mm2(float(faces.area[own].sum()))}, in hollow corners, as fillet welds"
    marked = np.isin(faces.of_triangle, own)
    leg_mm = 1e3 * leg_of_bevel(mesh.vertices, mesh.triangles, marked)
    beside_mm = max(0.5 * round(2.0 * leg_mm), 0.5)
    return [Surface(BEVELS, {"faces": keys}, marked, text, raises_stress=True, beside_mm=beside_mm)]


def _single(mesh: PartMesh, of: Surface, number: int) -> Surface | None:
    """Return one of several faces that are alike, by its number from 1; None if there is none."""
    faces = mesh.faces(crease_deg(mesh))
    own = np.unique(faces.of_triangle[of.triangles])
    if not 1 <= number <= len(own):
        return None
    face = int(own[number - 1])
    key: dict[str, object] = {"at_mm": faces.place_mm(face), "crease_deg": crease_deg(mesh)}
    marked = faces.of_triangle == face
    return Surface(
        f"{of.name}.{number}", {"faces": [key]}, marked, area_in_mm2(float(faces.area[face]))
    )


def single_sizes(mesh: PartMesh, of: Surface) -> dict[str, str]:
    """Return the area in words of each of several faces that are alike, by its name."""
    if not of.are_alike:
        return {}
    faces = mesh.faces(crease_deg(mesh))
    own = np.unique(faces.of_triangle[of.triangles])
    return {f"{of.name}.{k}": area_in_mm2(float(faces.area[one])) for k, one in enumerate(own, 1)}


def names_within(mesh: PartMesh, of: Surface, triangles: Sequence[int]) -> list[str]:
    """Return the names of the faces of a surface in which some of its triangles are.

    One of several faces that are alike has its number, such as "face 8.3".
    """
    faces = mesh.faces(crease_deg(mesh))
    own = np.unique(faces.of_triangle[of.triangles])
    if not of.are_alike:
        return [of.name] * len(triangles)
    numbers = np.searchsorted(own, faces.of_triangle[list(triangles)]) + 1
    return [f"{of.name}.{number}" for number in numbers]


def _way(normal: np.ndarray) -> str:
    """Return in words which axis of the part's file a normal (3,) is nearest to."""
    if not normal.any():
        return "all round"
    return f"to {nearest_axis(normal)}"


def nearest_axis(way: np.ndarray) -> str:
    """Return the axis that a direction (3,) is nearest to, as "+x"."""
    axis = int(np.abs(way).argmax())
    return f"{'-' if way[axis] < 0.0 else '+'}{'xyz'[axis]}"


def _named(mesh: PartMesh, name: str, marked: np.ndarray) -> Surface:
    area = float(areas(mesh.vertices, mesh.triangles[marked]).sum())
    return Surface(name, {"surface": [name]}, marked, area_in_mm2(area))


def _is_vivid(name: str) -> bool:
    """True if a name is a vivid colour, such as #ff0000. A grey usually marks the whole body."""
    found = COLOUR.match(name)
    levels = [int(level, 16) for level in found.groups()] if found else [0]
    return max(levels) - min(levels) > VIVID


def _from_red(colour: str) -> float:
    """Return the distance of a colour's hue from red, the usual mark, from 0 to 1/2."""
    hue = colorsys.rgb_to_hsv(*bytes.fromhex(colour[1:]))[0]
    return min(hue, 1.0 - hue)


def _count(surface: Surface) -> int:
    return int(re.match(r"\d+", surface.text)[0])  # type: ignore[index]


def find_surface(mesh: PartMesh, known: Sequence[Surface], name: str) -> Surface:
    """Return the surface of a name, such as "face 3" or "face 3.1".

    Args:
        known: all surfaces of `surfaces`.
    Raises:
        InputError: there is none of this name.
    """
    alike = [one for one in known if one.name.lower() == name.lower()]
    if alike:
        return min(alike, key=lambda one: one.name != name)
    if name.lower() == "all":
        whole = np.ones(len(mesh.triangles), dtype=bool)
        return Surface("all", WHOLE, whole, "the whole surface")
    if (found := SINGLE.fullmatch(name)) is not None:
        of = [one for one in known if one.name.lower() == found[1].lower() and "faces" in one.keys]
        if of and (single := _single(mesh, of[0], int(found[2]))) is not None:
            return single
    if FACE.fullmatch(name):
        faces = [one.name for one in known if FACE.fullmatch(one.name)]
        text = f"the part has {faces[0]} to {faces[-1]}"
        raise InputError(f"--target: given {name!r}, but {text}")
    if not mesh.groups:
        text = (
            "its file names no surface: give face 1, face 2 ..., of which --target pick shows all"
        )
        raise InputError(f"--target: given {name!r}, but {text}")
    return _named(
        mesh, name, select_triangles(mesh.groups, [name], len(mesh.triangles), "--target")
    )


def _joined(chosen: Sequence[Surface], reason: str) -> Target:
    """Return one target made of several surfaces.

    Raises InputError if surfaces that the file names are mixed with faces.
    """
    keys: Keys = {}
    for one in chosen:
        for key, values in one.keys.items():
            keys.setdefault(key, []).extend(values)
    if len(keys) > 1:
        text = "names of the file and faces cannot be one target; give one kind"
        raise InputError(f"--target: given {[one.name for one in chosen]}; {text}")
    marked = np.any([one.triangles for one in chosen], axis=0)
    if all(one.beside_mm for one in chosen):
        keys["beside_mm"] = beside_mm = max(one.beside_mm for one in chosen)
        where = "the fillets by rule of thumb, so that it runs out"
        if chosen[0].name == BEVELS:
            where = (
                "the toes, as wide as the leg of the weld by rule of thumb, as cracks begin there"
            )
        reason = (
            f"with {beside_mm:g} mm of the faces beside {where} (no source read, "
            f"part.target.beside_mm changes it); {reason}"
        )
    names = [one.name for one in chosen]
    listed = ", ".join(names if len(names) <= MOST_NAMED else names[: MOST_NAMED - 1])
    if len(names) > MOST_NAMED:
        listed += f" and {len(names) - MOST_NAMED + 1} more"
    return Target(keys, marked, f"{listed}: {reason}")


def named_or_all(known: Sequence[Surface]) -> Sequence[Surface]:
    """Return the surfaces that have a name in the part's file; all if none has."""
    return [one for one in known if "surface" in one.keys] or known


def apart(areas: Sequence[tuple[Surface, float, np.ndarray]]) -> list[tuple[Surface, float]]:
    """Return surfaces with their areas, the largest first, without those made of the others.

    A body is left out where its faces are named too, and a colour where names say the same.

    Args:
        areas: surfaces, the area that counts of each, and the area of each triangle in it, (m,).
    """
    kept: list[tuple[Surface, float]] = []
    told = np.zeros_like(areas[0][2]) if areas else np.empty(0)
    for one, area, each in sorted(areas, key=lambda one: (one[0].name.startswith("#"), one[1])):
        if each[told > 0.0].sum() <= TOLD * area:
            kept.append((one, area))
            told = np.maximum(told, each)
    return sorted(kept, key=lambda one: -one[1])


def area_in_mm2(area: float) -> str:
    """Return an area [m²] as text in mm², whole from 100 on, so that surfaces are told apart."""
    return f"{plain(1e6 * area, 3)} mm²"
