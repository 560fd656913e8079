"""Propose a whole design for a part, with a wider chamber if its own check warns of gaps.

Every number comes from a rule of thumb, with its reason beside it. A study then varies the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import shot_reach, warnings
from chamberopt.chamber.checks.fillets import OF_FILLET, inner_edges
from chamberopt.chamber.largest_ball import largest_balls, spread_points
from chamberopt.chamber.propose.pose import pose_in_words, propose_pose, square_to_walls
from chamberopt.chamber.propose.proposed_target import (
    Sizes,
    Surface,
    Target,
    propose_sizes,
    propose_target,
    shape_for,
    surfaces,
)
from chamberopt.chamber.reach import TOLERATED_OVERLAP, Reach
from chamberopt.chamber.scene import MAX_BALLS
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.progress import step
from chamberopt.common.toml_fields import MAX_COORDINATE_MM, allowed_range
from chamberopt.design.design import Design, validate
from chamberopt.design.materials import CATALOGUE, USUAL, alloy, ball, balls
from chamberopt.design.shape_surface import TAG_SONOTRODE
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shot import ShotTable
from chamberopt.geometry.meshes.part_mesh import PartMesh, read_part
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.meshes.units import GUESSED
from chamberopt.geometry.triangles import area_vectors, areas, rotation_matrix, unit_vectors

POINTS = 20_000  # on the target
MISSED = 0.05  # share of the target's area that a larger ball may leave out


def touched_shares(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, diameters: Sequence[float]
) -> np.ndarray:
    """Return the share of a part's target that balls of each diameter [m] can touch from any side.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, normals outward, shape (m, 3).
        target: marks the triangles of the target, the surface to peen, shape (m,).
    Returns:
        The share for each diameter.
    """
    from sim_core import TriangleMesh

    own = triangles[target]
    spacing = np.full(len(own), np.sqrt(areas(vertices, own).sum() / POINTS))
    triangle, point, area = spread_points(vertices, own, spacing)
    normal = unit_vectors(area_vectors(vertices, own))[triangle]
    mesh = TriangleMesh(vertices, triangles, np.zeros(len(triangles), dtype=np.uint8))
    overlap = TOLERATED_OVERLAP * 0.5 * min(diameters)
    radius = largest_balls(mesh, point, normal, 0.5 * max(diameters), overlap)[0]
    touched = [area[radius >= 0.5 * one - overlap].sum() for one in diameters]
    return np.asarray(np.array(touched) / area.sum())


def fit_fillets(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, diameters: Sequence[float]
) -> np.ndarray:
    """Return True for each ball diameter [m] that is small enough for the target's fillets.

    Inner edges without a fillet are left out, because no ball fits there.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, normals outward, shape (m, 3).
        target: marks the triangles of the target, the surface to peen, shape (m,).
    """
    _, length, radius = inner_edges(vertices, triangles, target)
    small = [(radius > 0.0) & (OF_FILLET * radius < one) for one in diameters]
    return np.array([length[own].sum() < one for own, one in zip(small, diameters, strict=True)])


def propose_ball(
    shares: np.ndarray, fits: np.ndarray, diameters: Sequence[float]
) -> tuple[float, str]:
    """Return the diameter [m] of the proposed ball, and the reason for it.

    It is the largest ball that touches nearly as much of the target as the smallest ball does. It
    is also small enough for the fillets, if there is such a ball.

    Args:
        shares: share of the target that balls of each diameter can touch.
        fits: True for each diameter that is small enough for the target's fillets.
        diameters: diameters of the balls [m], in ascending order.
    """
    touching = shares >= shares[0] - MISSED
    both = touching & fits
    chosen = int(np.flatnonzero(both if both.any() else touching)[-1])
    reason = f"touches {shares[chosen]:.0%} of the target"
    if both.any() and not fits.all():
        reason += ", at most half the radius of its fillets"
    elif chosen + 1 < len(diameters):
        larger = f"{1e3 * diameters[chosen + 1]:g} mm {shares[chosen + 1]:.0%}"
        reason += f", balls of {larger}"
    return diameters[chosen], reason


LAYER, PACKED = 0.25, 0.9069  # layers of balls in the charge; share of a plane under a full layer
LIGHTER, HEAVIER = 0.4, 2.5  # charges of the study, as shares of the first
FINE_MM, COARSE_MM = 0.5, 1.0  # steps of lengths
FEW_MM = 400.0  # longest range with fine steps: a study takes at most 999 steps
LARGEST_MM = allowed_range(ParametricChamber.model_fields["height_mm"])[1]  # side of a chamber
HEAVIEST_G = allowed_range(ShotTable.model_fields["mass_g"])[1]


class Range(NamedTuple):
    """The range in which a study varies a number, in its unit, and the step between values."""

    low: float
    high: float
    step: float


def propose_charge(floor: float, diameter: float, ball_mass: float) -> tuple[float, str]:
    """Return the mass of all balls together [g], to two digits, and the reason for it.

    Args:
        floor: area of the sonotrode [m²].
        diameter, ball_mass: diameter [m] and mass [kg] of a ball.
    """
    count = max(1, round(LAYER * PACKED * floor / (math.pi / 4.0 * diameter**2)))
    wanted, most = 1e3 * count * ball_mass, _heaviest_g(ball_mass)
    if wanted > most:
        return most, "the most that is supported, less than a quarter of a layer of balls"
    return min(float(f"{wanted:.2g}"), most), "a quarter of a layer of balls on the sonotrode"


def propose_ranges(
    sizes: Sizes, mass_g: float, ball_mm: float, ball_mass: float
) -> dict[str, Range]:
    """Return the range of each number that the proposed study varies, by dotted name.

    Args:
        sizes: sizes of the chamber.
        mass_g: mass of all balls together.
        ball_mm: ball diameter.
        ball_mass: mass of one ball [kg].
    """
    distance, height = round(1e3 * sizes.distance), round(1e3 * sizes.height)
    far = round(1.25 * distance)
    near = max(round(0.4 * distance), math.ceil(2.0 * ball_mm))
    # The ceiling stays above the part even when the part is highest, so that no ball is caught.
    low = math.ceil(far + 1e3 * sizes.top + 2.0 * ball_mm)
    high = min(round(1.5 * height), LARGEST_MM)
    digit = _second_digit(mass_g)
    least, most = (digit * round(share * mass_g / digit) for share in (LIGHTER, HEAVIER))
    mass = (least, min(most, _heaviest_g(ball_mass)), digit)
    return {
        "chamber.height_mm": _lengths(min(low, height), high),
        "chamber.sonotrode_distance_mm": _lengths(min(near, distance), far),
        "shot.mass_g": Range(*(float(f"{one:.6g}") for one in mass)),
    }


def _lengths(low: float, high: float) -> Range:
    """Return the range between two lengths [mm], with fine steps unless it is long."""
    return Range(low, high, FINE_MM if high - low <= FEW_MM else COARSE_MM)


def _second_digit(mass: float) -> float:
    """Return the value of one step in a mass's second significant digit, such as 10 for 345."""
    return 10.0 ** (math.floor(math.log10(mass)) - 1)


def _heaviest_g(ball_mass: float) -> float:
    """Return the largest mass of all balls [g], to two digits, that the program takes.

    Args:
        ball_mass: mass of one ball [kg].
    """
    most = min(1e3 * MAX_BALLS * ball_mass, HEAVIEST_G)
    digit = _second_digit(most)
    return float(f"{digit * math.floor(most / digit + 1e-9):.6g}")


LARGEST_BALL = 3e-3  # m: larger balls are in use, but they are few and slow to cover
BALLS_ACROSS = 50  # ball diameters across the part's width: smaller balls come in thousands
WIDER = (1.0, 1.4, 2.0)  # factors on the room round the part that are tried
AMPLITUDE_UM, FREQUENCY_KHZ = 40.0, 20.0
USUAL_PART, WALL, SONOTRODE = "42CrMo4", "42CrMo4", "Ti-6Al-4V"  # of the catalogue
TREATMENT_S, HALF_WIDTH = 300.0, 0.01

Tables = dict[str, dict[str, Any]]
"""Tables of a design file by dotted name, as TOML values."""


@dataclass(frozen=True)
class Wanted:
    """The user's wishes for a proposed design. None or an empty text leaves the choice open."""

    unit: str = "guess"
    shape: str | None = None
    alloy: str = ""
    shot: str = "steel"
    ball_mm: float | None = None


@dataclass(frozen=True)
class Proposal:
    """A proposed design, the reason for each value, and the warnings of its check."""

    design: Design
    tables: Tables  # the values of the design file
    reasons: dict[str, str]  # of values, by dotted name
    bounds: dict[str, Range]  # of the study
    known: tuple[Surface, ...]  # surfaces to choose the target from
    mesh: PartMesh
    chamber: Chamber
    reach: Reach
    warnings: tuple[str, ...]


def propose(
    path: Path, wanted: Wanted, choose: Callable[[Sequence[Surface]], Sequence[str]]
) -> Proposal:
    """Propose a design for the part in a file.

    Args:
        choose: function that picks the names of the surfaces to peen from all surfaces.
    Raises:
        InputError: the part cannot be used, or no chamber can be built round it.
    """
    part_alloy, shot = alloy(wanted.alloy or USUAL_PART).name, _shot(wanted.shot)
    with step("reading the part"):
        mesh = _read(path, wanted.unit)
        known = surfaces(mesh)
    target = propose_target(mesh, known, choose(known))
    _require_near_origin(path, target)
    turns, pose_reason = propose_pose(mesh.vertices, mesh.triangles, target.triangles)
    with step("choosing the balls"):
        diameter, ball_reason = _ball_diameter(mesh, target, wanted)
    square = square_to_walls(mesh.vertices, turns)
    shape = wanted.shape or shape_for(np.ptp(mesh.vertices @ rotation_matrix(square).T, axis=0))
    turns = square if shape == "box" else turns
    posed = mesh.vertices @ rotation_matrix(turns).T
    posed[:, 2] -= posed[:, 2].min()
    top = float(posed[mesh.triangles[target.triangles], 2].max())
    tables: Tables = {
        "part": {"mesh": str(path.resolve()), "unit": mesh.unit, "rotate_deg": list(turns)},
        "part.target": target.keys,
        "chamber": {},
        "sonotrode": {"frequency_khz": FREQUENCY_KHZ, "amplitude_um": AMPLITUDE_UM},
        "shot": {"mass_g": 1.0, "diameter_mm": round(1e3 * diameter, 4), "material": shot},
        "materials": {"part": part_alloy, "wall": WALL, "sonotrode": SONOTRODE},
        "effects": {"gravity": True, "friction": CATALOGUE, "roughness": USUAL},
        "process": {"treatment_time_s": TREATMENT_S, "seed": 1},
        "process.accuracy": {
            "replicas": 8,
            "simulated_time_s": 2.0,
            "warmup_time_s": 0.2,
            "objective_half_width": HALF_WIDTH,
        },
    }
    reasons = {
        "part.unit": ("GUESSED: " if any(GUESSED in note for note in mesh.notes) else "")
        + f"the part measures {format_box(mesh.size)}",
        "part.rotate_deg": f"{pose_in_words(mesh, known, turns)}: {pose_reason}",
        "part.target": target.reason,
        "sonotrode.amplitude_um": "ZERO-TO-PEAK, half of peak-to-valley; take your machine's",
        "shot.diameter_mm": ball_reason,
        "materials.part": "C0 and v0 are computed: to be calibrated"
        if wanted.alloy
        else "NOT KNOWN, a guess: chamberopt materials lists alloys",
        "effects.friction": "mu of these balls on these metals, dry: chamberopt materials",
        "effects.roughness": "rms slope of faces that shot has dented",
        "process.treatment_time_s": "a start: the report has coverage over time",
        "process.accuracy.objective_half_width": "replicas are added until it is this sure",
    }
    best: Proposal | None = None
    refused: InputError | None = None
    with step("building and checking the chamber") as progress:
        for number, wider in enumerate(WIDER):
            progress(number, len(WIDER), None)
            sizes = propose_sizes(posed, top, diameter, shape, wider)
            tables["chamber"] = _chamber_table(sizes)
            try:
                made = _checked(tables, {**reasons, **_size_reasons(sizes)}, sizes, known, mesh)
            except UnreadableError:
                raise
            except InputError as error:
                refused = refused or error
                continue
            if best is None or len(made.warnings) < len(best.warnings):
                best = made
            if not any(word in text for text in made.warnings for word in ("gap", "side wall")):
                break
    if best is None:
        assert refused is not None
        raise refused
    return best


def _shot(name: str) -> str:
    """Return the catalogue's name of a material of balls.

    Raises InputError if it is unknown, or its hardness and so its restitution is not known.
    """
    found = ball(name)
    if found.hardness_HB is None:
        known = ", ".join(one.name for one in balls() if one.hardness_HB is not None)
        text = "the hardness of these balls is not known, and their restitution follows from it"
        raise InputError(f"--shot: given {name!r}; {text}; give one of {known}")
    return found.name


def _read(path: Path, unit: str) -> PartMesh:
    """Return the part in a file. Messages name the option --unit, not the design's part.unit."""
    try:
        mesh = read_part(path, unit)
    except InputError as error:
        error.args = (str(error).replace("part.unit", "--unit"),)
        raise
    return replace(mesh, notes=tuple(note.replace("part.unit", "--unit") for note in mesh.notes))


def _require_near_origin(path: Path, target: Target) -> None:
    """Raise InputError if a face of the target has larger coordinates than a design may have."""
    far = max((abs(x) for face in target.keys.get("faces", ()) for x in face["at_mm"]), default=0)
    if far > MAX_COORDINATE_MM:
        text = f"the part is {1e-3 * far:.4g} m from the origin of its file"
        most = f"at most {1e-3 * MAX_COORDINATE_MM:g} m are allowed"
        raise InputError(f"{path}: {text}, {most}; move it to the origin in CAD and export again")


def _ball_diameter(mesh: PartMesh, target: Target, wanted: Wanted) -> tuple[float, str]:
    """Return the wanted or proposed diameter of the balls [m], and the reason for it."""
    if wanted.ball_mm is not None:
        return 1e-3 * wanted.ball_mm, "as asked"
    least = float(np.sort(mesh.size)[1]) / BALLS_ACROSS
    sold = [
        size
        for size in (6e-4, 8e-4, 1e-3, 1.2e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3, 4e-3)
        if size <= LARGEST_BALL
    ]
    sizes = [size for size in sold if size >= least] or sold[-1:]
    surface = mesh.vertices, mesh.triangles, target.triangles, sizes
    return propose_ball(touched_shares(*surface), fit_fillets(*surface), sizes)


def _chamber_table(sizes: Sizes) -> dict[str, float | str]:
    distance, height = round(1e3 * sizes.distance, 3), round(1e3 * sizes.height, 3)
    return {
        "shape": sizes.shape,
        **sizes.plan,
        "height_mm": height,
        "sonotrode_distance_mm": distance,
    }


def _size_reasons(sizes: Sizes) -> dict[str, str]:
    first = next(key for key in sizes.plan if key.endswith("_mm"))
    where = "the part goes out through it" if sizes.through_ceiling else "it hangs without a holder"
    return {
        f"chamber.{first}": f"leaves {1e3 * sizes.gap:.3g} mm beside the part",
        "chamber.height_mm": f"sonotrode to ceiling; {where}",
        "chamber.sonotrode_distance_mm": "mean sonotrode face to the part's lowest point",
    }


def _checked(
    tables: Tables, reasons: dict[str, str], sizes: Sizes, known: Sequence[Surface], mesh: PartMesh
) -> Proposal:
    """Choose the mass of the balls for these values, and return the built and checked proposal.

    Raises InputError if the chamber would be too large or cannot be built.

    Args:
        tables: tables of the design file. Their mass of the balls is replaced.
        reasons: reason for each value, by dotted name.
        sizes: sizes of the chamber, from which the ranges of the study follow.
        known: surfaces to choose the target from.
        mesh: the part.
    """
    largest = max(size for key, size in tables["chamber"].items() if key.endswith("_mm"))
    if largest > LARGEST_MM:
        text = f"the part measures {format_box(mesh.size)}, too much for a chamber: it would need"
        most = f"{largest:g} mm, and {LARGEST_MM:g} mm are the most"
        raise InputError(f"{text} {most}; check --unit, or cut the part down to what is peened")
    design = validate(Design, _nested(tables))
    chamber = build_chamber(design)
    floor = float(areas(chamber.vertices, chamber.triangles)[chamber.tags == TAG_SONOTRODE].sum())
    diameter, ball_mass = design.shot.diameter, design.shot.ball_mass
    mass_g, reason = propose_charge(floor, diameter, ball_mass)
    tables = {**tables, "shot": {**tables["shot"], "mass_g": mass_g}}
    design = validate(Design, _nested(tables))
    reach = shot_reach(design, chamber)
    reasons = {**reasons, "shot.mass_g": f"{reason}: {design.shot.count}"}
    found = tuple(warnings(design, chamber, reach))
    bounds = propose_ranges(sizes, mass_g, 1e3 * diameter, ball_mass)
    return Proposal(design, tables, reasons, bounds, tuple(known), mesh, chamber, reach, found)


def _nested(tables: Tables) -> dict[str, object]:
    """Return tables with dotted names, such as "part.target", as tables inside each other."""
    nested: dict[str, Any] = {}
    for name, values in tables.items():
        table = nested
        for key in name.split("."):
            table = table.setdefault(key, {})
        table.update(values)
    return nested
