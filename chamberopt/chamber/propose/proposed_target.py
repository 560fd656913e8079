"""Propose the surface of a part to peen, and the sizes of a chamber round the part.

The surface is chosen from names in the part's file and from faces between sharp edges.
"""

from __future__ import annotations

import colorsys
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

import numpy as np

from chamberopt.chamber.fixture import is_hole
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.design.tolerances import iso_2768_m
from chamberopt.geometry.heights import points_up_to
from chamberopt.geometry.meshes.part_mesh import PartMesh, select_triangles
from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    border_edges,
    side_pairs,
    sides_of,
    unit_vectors,
)

# Room for balls to get round the part and gather speed, in ball diameters and as a share of the
# part's width. A study varies these starting points.
SIDE_GAP, GAP_SHARE, MIN_GAP = 5.0, 0.15, 4e-3
DISTANCE, DISTANCE_SHARE, MIN_DISTANCE = 6.0, 0.2, 8e-3
ABOVE = 5.0  # ball diameters between target and ceiling
CLOSEST = 0.6  # share of that which is left where the ceiling lies off a face of the part
ROUNDS = 3  # in which what is below the ceiling and the sonotrode's distance follow each other
# Edges of a part that turn by more are at one level if they lie within ONE_LEVEL [m]; they count if
# together they are longer than this share of the rectangle round the part.
LEVEL_EDGE_DEG, ONE_LEVEL, MUCH = 20.0, 1e-5, 0.05
SEEN = 1e-3  # m of a part that stand out above a ceiling at least
OVER_LEDGE = 2.0  # ball diameters between a face that looks up and a ceiling over it
SHAPES = ("cylinder", "box", "prism", "conformal")
TOLD = 0.5  # share of a surface that others named tell of, from which on it is not named
LONG = 1.6  # least length over width of a part whose sides the walls follow
SIDES = 6  # of a prism


@dataclass(frozen=True)
class Sizes:
    """Shape and sizes of a proposed chamber round a part."""

    shape: str
    plan: dict[str, float | str]  # keys of [chamber] for its form in plan, and their values
    distance: float  # sonotrode to part [m]
    height: float  # [m]
    gap: float  # part to side wall [m]
    through_ceiling: bool  # true if the part goes out through the ceiling
    top: float  # height over the part's lowest point that must be below the ceiling [m]
    closed: tuple[str, ...] = ()  # sides at which a face of the part is the wall, such as "-x"

    @property
    def is_fixed(self) -> bool:
        """Whether faces of the part are walls on two opposite sides, so that its plan is fixed."""
        return any({axis, f"-{axis}"} <= {*self.closed} for axis in "xy")

    def lengths_mm(self) -> dict[str, float]:
        """Return the lengths of these sizes by their keys of [chamber]."""
        lengths = {key: one for key, one in self.plan.items() if isinstance(one, float)}
        height, distance = round(1e3 * self.height, 3), round(1e3 * self.distance, 3)
        return {**lengths, "height_mm": height, "sonotrode_distance_mm": distance}


def shape_for(box: np.ndarray) -> str:
    """Return the name of the chamber's shape for a part with a bounding box of these sides (3,).

    It is "box" if the part is long seen from above, else "cylinder".
    """
    return "box" if max(box[:2]) > LONG * min(box[:2]) else "cylinder"


def propose_sizes(
    vertices: np.ndarray,
    target_top: float,
    ball: float,
    shape: str,
    wider: float = 1.0,
    target: np.ndarray | None = None,
    triangles: np.ndarray | None = None,
) -> Sizes:
    """Return the sizes of a chamber of the named shape, with room for balls round the part.

    A part that goes out through the ceiling needs room round what of it is below. Such a ceiling
    lies off the part's level faces, so that it meets the same section however it is set up.

    Args:
        vertices: vertices of the turned part, with its lowest point at z = 0 [m], shape (n, 3).
        target_top: height of the target's highest point [m].
        ball: diameter of a ball [m].
        wider: factor on the room beside, below and above the part.
        target: vertices of the target alone [m], shape (k, 3), for a chamber round the target whose
            walls the part goes out through; None for one round the part.
        triangles: of the part, (m, 3), where all of its faces count; None to look at its vertices.
    """
    top = float(vertices[:, 2].max())
    above = ABOVE * ball * wider
    through = top > target_top + 2.0 * above
    below = target_top if through else top

    def room_below(points: np.ndarray) -> tuple[float, float]:
        """Return the sonotrode's distance and the height [m] for the points below the ceiling."""
        width = float(np.ptp(points[:, :2], axis=0).max())
        least = max(DISTANCE * ball, DISTANCE_SHARE * min(width, top), MIN_DISTANCE)
        distance = 1e-3 * _up_mm(least * wider)
        height = 1e-3 * _up_mm(distance + below + above)
        if through and triangles is not None:
            ends = distance + below + CLOSEST * above, min(height + above, distance + top - SEEN)
            height = _off_ledges(vertices, triangles, distance, height, ends, ball)
        return distance, height

    distance, height = room_below(vertices)
    inside = vertices if target is None else target
    if target is None and through:
        for _ in range(ROUNDS):
            inside = _up_to(vertices, triangles, height - distance)
            distance, height = room_below(inside)
    middle = middle_in_plan(vertices if target is None else target)  # on the chamber's axis
    half = np.abs(inside[:, :2] - middle).max(axis=0)
    gap = max(SIDE_GAP * ball, GAP_SHARE * 2.0 * float(half.max()), MIN_GAP) * wider
    radius = float(np.linalg.norm(inside[:, :2] - middle, axis=1).max())
    across = _up_mm(2.0 * (radius + gap))
    plans: dict[str, dict[str, float | str]] = {
        "cylinder": {"diameter_mm": across},
        "box": dict(zip(("length_mm", "width_mm"), map(_up_mm, 2.0 * (half + gap)), strict=True)),
        "prism": {"sides": SIDES, "across_mm": across},
        "conformal": {"outline": "hull", "gap_mm": _up_mm(gap)},
    }
    return Sizes(shape, plans[shape], distance, height, gap, through, below)


def _up_to(vertices: np.ndarray, triangles: np.ndarray | None, level: float) -> np.ndarray:
    """Return points (k, 3) [m] round what of a part is not above a level [m]."""
    if triangles is None:
        return vertices[vertices[:, 2] <= level + 1e-9]
    return points_up_to(vertices, triangles, level)


def _ledges(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the heights [m] at which a part's section changes, and which look up, both (k,).

    They are those of level edges that are long together: where the part turns sharply, as at a face
    or a chamfer, and the lowest and highest lines of rounds, as of a level bore.
    """
    pairs = side_pairs(triangles)
    ends = vertices[sides_of(triangles)[pairs[:, 0]]]
    is_level = np.abs(ends[:, 1, 2] - ends[:, 0, 2]) < ONE_LEVEL
    pairs, ends = pairs[is_level], ends[is_level]
    normal = unit_vectors(area_vectors(vertices, triangles))[pairs // 3]
    # A side goes from a corner of its triangle to the next; the third corner is opposite.
    opposite = vertices[triangles[pairs // 3, (pairs % 3 + 2) % 3], 2] - ends[:, :1, 2]
    is_turn = (opposite >= -ONE_LEVEL).all(axis=1) | (opposite <= ONE_LEVEL).all(axis=1)
    cosine = np.einsum("ij,ij->i", normal[:, 0], normal[:, 1])
    used = is_turn | (cosine < np.cos(np.radians(LEVEL_EDGE_DEG)))
    up = normal[used, :, 2].sum(axis=1) > 0.0
    length = np.linalg.norm(ends[used, 1] - ends[used, 0], axis=1)
    key = 2.0 * np.round(ends[used, 0, 2] / ONE_LEVEL) + up
    keys, row = np.unique(key, return_inverse=True)
    around = 2.0 * float(np.ptp(vertices[:, :2], axis=0).sum())
    keys = keys[np.bincount(row, length, len(keys)) > MUCH * around]
    return ONE_LEVEL * np.floor(0.5 * keys), keys % 2.0 == 1.0


def _off_ledges(
    vertices: np.ndarray,
    triangles: np.ndarray,
    distance: float,
    height: float,
    ends: tuple[float, float],
    ball: float,
) -> float:
    """Return the height [m] of a ceiling between two ends that is off all ledges of a part.

    It keeps twice its tolerance off them, so that the ceiling meets one section of the part, and
    over those that look up two balls. It is lowered, so that the face goes out and no ball lies on
    it, or else raised. It stays where there is no such height.

    Args:
        vertices, triangles, ball: as of propose_sizes.
        distance, height, ends: over the sonotrode [m]: the part's lowest point, and the ceiling.
    """
    levels, up = _ledges(vertices, triangles)
    off = 2e-3 * iso_2768_m(1e3 * height)
    over = np.where(up, max(OVER_LEDGE * ball, off), off)

    def is_free(one: float) -> bool:
        above = one - distance - levels
        return not ((above > 1e-9 - off) & (above < over - 1e-9)).any()

    if is_free(height):
        return height
    most = math.ceil(1e3 * (ends[1] - ends[0]))
    tried = (height + way * k for way in (-1e-3, 1e-3) for k in range(1, most + 1))
    inside = (one for one in tried if ends[0] - 1e-9 <= one <= ends[1] + 1e-9)
    return round(next((one for one in inside if is_free(one)), height), 9)


def middle_in_plan(points: np.ndarray) -> np.ndarray:
    """Return the middle of the box round points (n, 3), seen from above, (2,)."""
    return np.asarray(0.5 * (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)))


def _up_mm(length: float) -> float:
    """Return a length given in m in whole millimetres, rounded up."""
    return float(math.ceil(1e3 * length - 1e-6))


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
# Names of what runs in bearings: where they are no target, its size and finish must stay.
RUNNING = re.compile(r"(?<![a-z])(?:pin|journal|race|bearing|zapfen)s?(?![a-z])", re.I)
CONFIRM = "confirm that it is what fails in use (choose another: --target)"
BY_SIZE, BY_SHAPE = f"CHOSEN BY SIZE ALONE: {CONFIRM}", f"CHOSEN BY SHAPE: {CONFIRM}"
AS_LARGE = 0.9  # of the largest face's area: the target takes a face as large, e.g. a blade's back
ALL_ROUND = 0.2  # sum of a face's area vectors over its area, below which it goes all round
PATTERN = 6  # number of alike faces that make a repeated feature, such as teeth
# Such features are at least this share of the part's area, and stand round an axis: the variances
# of their middles along both axes of their plane differ by less than RING.
LARGE_PATTERN, RING = 0.1, 0.1
# A face may go on from tooth to tooth: the mean radius over the angle round its axis then swings by
# so much of itself or more, and repeats: this share of its variance is that of one harmonic and of
# its multiples.
SWING, PERIODIC, ANGLES = 0.02, 0.8, 720
FLAT = 0.95  # sum of a face's area vectors over its area, above which it is flat
SHARPER_DEG = 45.0, 60.0  # of edges, where those of CREASE_DEG part a coarse mesh into facets
COLOUR, VIVID = re.compile(r"#([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$", re.I), 100
BY_PROGRAM = re.compile(r"(?:created|exported|generated|written)[\s_-]+(?:by|from|with)\b", re.I)
NUMBERED = re.compile(r"(?:pid|set|zone)[\s_]*\d+$", re.I)  # names that say nothing
FACE = re.compile(r"face (\d+)", re.I)
# A fillet is a hollow face of a CAD file that goes on smoothly at this share of its border or more,
# up to this angle. Its radius is less than this share of the part's size.
SMOOTH_BORDER, SMOOTH_DEG, WIDE_FILLET = 0.5, 10.0, 0.2
SAME_RADIUS = 0.02  # relative difference of radii below which fillets are of one radius
MOST_NAMED = 5  # surfaces of a target that are named; of more, the first are
Keys = dict[str, Any]
"""Keys of [part.target], "surface" or "faces", and their values."""

WHOLE: Keys = {"surface": ["all"]}


@dataclass(frozen=True)
class Surface:
    """A surface that can be the target: named by the file, or a face with all faces like it."""

    name: str  # value for --target
    keys: Keys
    triangles: np.ndarray  # (m,) bool
    text: str  # description in a few words
    colour: str = ""  # colour of just these triangles in the file
    alone: str = ""  # names of each of its faces, and where they look, if they are few


@dataclass(frozen=True)
class Target:
    """The proposed surface to peen, and the reason for it."""

    keys: Keys
    triangles: np.ndarray  # (m,) bool
    reason: str


def surfaces(mesh: PartMesh) -> list[Surface]:
    """Return all surfaces that the target can be chosen from.

    First are the surfaces that the file names, then fillets and faces, each the largest first.
    """
    return [*named_surfaces(mesh), *_fillets(mesh), *_faces(mesh)]


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
    fillets = [one for one in faces if one.keys["faces"][0].get("cad_face")]
    faces = [one for one in faces if one not in fillets]
    repeated = [one for one in faces if one.keys["faces"][0].get("alike")]
    counts = {one.name: _count(one) for one in repeated}
    features = [one for one in repeated if counts[one.name] >= PATTERN and _is_ring(mesh, one)]
    patterns: list[tuple[list[Surface], str]] = []
    if features:
        best = max(features, key=lambda one: float(area[one.triangles].sum()))
        fits = {counts[best.name] * k // 2 for k in (1, 2, 4)}
        pattern = [one for one in features if counts[one.name] in fits]
        patterns.append((pattern, "faces that repeat round the part, such as those of teeth"))
    single = [(one, _teeth(mesh, one)) for one in faces if one not in repeated]
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
        text = f"by their shape, as such are usually peened{beside(faces)}; {BY_SHAPE}"
        return _joined(fillets, text)
    sizes = [area[one.triangles].sum() for one in faces]
    large = [one for one, size in zip(faces, sizes, strict=True) if size >= AS_LARGE * sizes[0]]
    large = [large[0], *(one for one in large[1:] if not _is_inside(mesh, one))]
    return _joined(large, by_size("the largest between sharp edges", faces[len(large) :]))


def crease_deg(mesh: PartMesh) -> float:
    """Return the angle of the edges between the faces of a part [degrees]: CREASE_DEG or sharper.

    It is the least at which few of the faces are facets; the sharpest if none is.
    """
    tried = CREASE_DEG, *SHARPER_DEG
    return next((one for one in tried if not mesh.faces(one).are_facets.any()), tried[-1])


def _is_ring(mesh: PartMesh, alike: Surface) -> bool:
    """Return whether faces that are alike stand evenly round an axis."""
    faces = mesh.faces(crease_deg(mesh))
    of, own = faces.of_triangle[alike.triangles], areas(mesh.vertices, mesh.triangles)
    weight = own[alike.triangles]
    middle = mesh.vertices[mesh.triangles[alike.triangles]].mean(axis=1)
    numbers, row = np.unique(of, return_inverse=True)
    whole = np.bincount(row, weight)
    places = np.stack([np.bincount(row, weight * x) / whole for x in middle.T], axis=1)
    _, wide, widest = np.linalg.eigvalsh(np.cov(places.T, bias=True))
    return len(numbers) > 2 and bool(widest - wide < RING * widest)


def _teeth(mesh: PartMesh, face: Surface) -> int:
    """Return how often a face repeats round its axis, such as one of all teeth; 0 if it does not.

    Its axis goes through its middle, across the plane in which it spreads alike. A flat face, such
    as the end of a gear, has no teeth.
    """
    vectors = area_vectors(mesh.vertices, mesh.triangles[face.triangles])
    if np.linalg.norm(vectors.sum(axis=0)) > FLAT * np.linalg.norm(vectors, axis=1).sum():
        return 0
    corners = mesh.vertices[mesh.triangles[face.triangles]]
    weight = areas(mesh.vertices, mesh.triangles[face.triangles])
    middles = corners.mean(axis=1)
    middles = middles - np.average(middles, axis=0, weights=weight)
    spread, axes = np.linalg.eigh(np.cov(middles.T, aweights=weight, bias=True))
    odd = 0 if spread[2] - spread[1] < spread[1] - spread[0] else 2
    x, y = (middles @ axes.T[k] for k in range(3) if k != odd)
    angle, radius = np.arctan2(y, x), np.hypot(x, y)
    own = np.floor((angle / (2.0 * np.pi) + 0.5) * ANGLES).astype(int) % ANGLES
    sums = np.bincount(own, weight, ANGLES), np.bincount(own, weight * radius, ANGLES)
    known = np.flatnonzero(sums[0])
    profile = sums[1][known] / sums[0][known]
    profile = np.interp(np.arange(ANGLES), known, profile, period=ANGLES)
    power = np.abs(np.fft.rfft(profile)[1:]) ** 2
    count = PATTERN + int(power[PATTERN - 1 :].argmax())
    if profile.std() < SWING * profile.mean() or not power.any():
        return 0
    share = power[count - 1 :: count].sum() / power.sum()
    return count if share >= PERIODIC else 0


def _is_inside(mesh: PartMesh, face: Surface) -> bool:
    """Return whether a face is the inside of a tube, which looks at itself all round."""
    triangles = mesh.triangles[face.triangles]
    vectors = area_vectors(mesh.vertices, triangles)
    size = float(np.linalg.norm(vectors, axis=1).sum())
    is_round = np.linalg.norm(vectors.sum(axis=0)) < ALL_ROUND * size
    return bool(is_round and is_hole(mesh.vertices, triangles))


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
    """Return the fillets of a part from CAD, those of one radius as one surface, by their area."""
    if mesh.numbering.cad_face is None or mesh.normals is None:
        return []
    faces, hollow = mesh.faces(None), _hollow_curvature(mesh)
    corner = np.arange(mesh.triangles.size).reshape(-1, 3)
    after = np.roll(corner, -1, axis=1).reshape(-1)  # of each corner, the next one of its triangle
    one, two = side_pairs(mesh.triangles).T  # a side begins at its corner, the other one ends there
    of, beyond = faces.of_triangle[one // 3], faces.of_triangle[two // 3]
    places, normals = mesh.vertices[mesh.triangles].reshape(-1, 3), mesh.normals.reshape(-1, 3)
    long = np.linalg.norm(places[one] - places[after[one]], axis=1) * (of != beyond)
    turn = np.einsum("ij,ij->i", normals[one], normals[after[two]])
    smooth = long * (turn > math.cos(math.radians(SMOOTH_DEG)))
    border, goes_on = (
        np.bincount(of, x, faces.count) + np.bincount(beyond, x, faces.count)
        for x in (long, smooth)
    )
    least = 1.0 / (WIDE_FILLET * float(np.linalg.norm(mesh.size)))
    bent = np.array([np.median(hollow[faces.of_triangle == k]) for k in range(faces.count)])
    left = np.flatnonzero((bent > least) & (goes_on >= SMOOTH_BORDER * border) & (border > 0.0))
    found = []
    while len(left):
        widest = bent[left[faces.area[left].argmax()]]
        own = left[np.abs(bent[left] / widest - 1.0) < SAME_RADIUS]
        left = np.setdiff1d(left, own)
        area = float(faces.area[own].sum())
        keys = [{"at_mm": faces.place_mm(int(k)), "cad_face": True} for k in own]
        count = f"{len(own)} faces, " if len(own) > 1 else ""
        name, marked = f"fillets of {1e3 / widest:.3g} mm", np.isin(faces.of_triangle, own)
        found.append((area, Surface(name, {"faces": keys}, marked, count + area_in_mm2(area))))
    return [one for _, one in sorted(found, key=lambda pair: -pair[0])]


def _hollow_curvature(mesh: PartMesh) -> np.ndarray:
    """Return the largest hollow curvature of each triangle [1/m], (m,), from its stated normals.

    The curvatures along the three sides make up its second fundamental form: S. Rusinkiewicz,
    "Estimating Curvatures and Their Derivatives on Triangle Meshes" (2004).
    """
    assert mesh.normals is not None
    corners = mesh.vertices[mesh.triangles]
    step, bend = (np.roll(x, -1, axis=1) - x for x in (corners, mesh.normals))
    along = unit_vectors(step[:, 0])
    across = np.cross(unit_vectors(area_vectors(mesh.vertices, mesh.triangles)), along)
    square = np.maximum(np.einsum("mki,mki->mk", step, step), 1e-30)
    u, v = (np.einsum("mki,mi->mk", step, axis) for axis in (along, across))
    form = np.stack([u * u, 2.0 * u * v, v * v], axis=2) / square[..., None]
    value = np.einsum("mki,mki->mk", bend, step) / square
    p, q, r = np.einsum("mij,mj->mi", np.linalg.pinv(form), value).T
    return np.asarray(np.hypot(0.5 * (p - r), q) - 0.5 * (p + r))


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
