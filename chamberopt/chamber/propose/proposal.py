"""A proposed design with its reasons and check, and its charge, ranges and tolerances."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import first_warnings, shot_reach, touched, warnings
from chamberopt.chamber.checks.jams import JamGap, gaps_in_reach, jam_gaps
from chamberopt.chamber.checks.warning import UNPEENED, DesignWarning, WarningKind
from chamberopt.chamber.layout.balls import MOST_BALLS, SizeFit, charge_of
from chamberopt.chamber.layout.end import HeldEnd, Strips
from chamberopt.chamber.layout.floor import Floor
from chamberopt.chamber.layout.pose import Pose, Turns, Upright
from chamberopt.chamber.layout.sizes import Sizes
from chamberopt.chamber.layout.target import Surface, Target
from chamberopt.chamber.layout.turning import Spindle
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.scene import MAX_BALLS, chamber_mesh
from chamberopt.chamber.shop import Shop, ShopSonotrode
from chamberopt.common.errors import InputError
from chamberopt.common.toml_fields import allowed_range
from chamberopt.design.design import Design, validate
from chamberopt.design.intensity import PredictedIntensity, WantedIntensity
from chamberopt.design.shape_surface import TAG_SONOTRODE
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shot import ShotTable
from chamberopt.design.tolerances import USUAL, iso_2768_m
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.triangles import areas

LIGHTER, HEAVIER = 0.4, 2.0  # charges of the study, as shares of the first
FINE_MM, COARSE_MM = 0.5, 1.0  # steps of lengths
FEW_MM = 400.0  # longest range with fine steps: a study takes at most 999 steps
LARGEST_MM = allowed_range(ParametricChamber.model_fields["height_mm"])[1]  # side of a chamber
HEAVIEST_G = allowed_range(ShotTable.model_fields["mass_g"])[1]
REPLICAS, MOST_REPLICAS = 10, 24  # the fewest that a wanted half-width takes, and the most
# Lengths that are set up. In plan the wall follows the sonotrode's face, with less clearance.
LENGTHS = ("height_mm", "sonotrode_distance_mm")
PEAK_TO_VALLEY_UM = USUAL["amplitude_pv_um"]
OF_AMPLITUDE = {"amplitude_um": 0.5 * PEAK_TO_VALLEY_UM, "amplitude_pv_um": PEAK_TO_VALLEY_UM}
OF_LENGTHS = "heights: ISO 2768-m; amplitude: SAE AMS 2580A; what they cost: simulate --tolerances"
# Warnings of fillets, slots and gaps that are too narrow, and of what no ball touches, which counts
# in what balls serve; of gaps that jam balls, which are counted; and of holes to be plugged later.
COUNTED = UNPEENED | {
    WarningKind.FILLET,
    WarningKind.SLOT,
    WarningKind.NARROW_GAP,
    WarningKind.JAM,
    WarningKind.WALL_IN_HOLE,
}
Tables = dict[str, dict[str, Any]]
"""Tables of a design file by dotted name, as TOML values."""


class HarmError(Exception):
    """A proposal does harm that another one does not; `warning` tells which."""

    def __init__(self, warning: DesignWarning) -> None:
        super().__init__(warning.message)
        self.warning = warning


@dataclass(frozen=True)
class Wanted:
    """The user's wishes for a proposed design. None or an empty text leaves the choice open."""

    unit: str = "guess"
    shape: str | None = None
    alloy: str = ""
    shot: str = ""  # material of the balls
    ball_mm: float | None = None
    pose: Pose | None = None
    shop: Shop | None = None  # what the shop has; usual sizes if it is not known
    calibration: Path | None = None  # file of the machine's calibration
    coverage: float | None = None  # [%], 200 is twice the time to 98 %
    turned_over: bool = False  # after half of the time, as a second step
    may_turn: bool = True  # about the axis of a bore, where that brings no new fault
    may_leave_end: bool = True  # out of the target, to hold the part by it
    # How a part that an end of thin metal would hold is held otherwise, where that was found: with
    # so many fillets fewer as its target, or in a pose.
    without_fillets: int = 0
    thick_pose: Upright | None = None


class Stance(NamedTuple):
    """How a part stands in its chamber, and what of it is peened there."""

    target: Target  # of which `end` leaves something out
    turns: Turns  # [degrees]
    why: str  # it is turned so
    end: HeldEnd | None = None  # an end that is left out, or all beside a strip
    is_local: bool = False  # true if the chamber is round the target, and the part goes out
    spindle: Spindle | None = None  # by which its ends turn it


@dataclass(frozen=True)
class BallTrial:
    """What is known of balls of one size for a proposal's target, each size in its own chamber.

    Attributes:
        ball_mm: their diameter.
        amplitude_um: of the sonotrode, zero-to-peak.
        count, sonotrode_count: of balls, and of sonotrodes side by side.
        fit: how the balls suit the target, without a chamber.
        time_to_98: after which 95 % of the target is 98 % covered, by a pilot [s]; None if that
            is not known.
        is_of_places: false if it is that of the target on average, as no place was resolved.
        intensity: Almen intensity by that pilot; None if it is not known.
        harm: why no pilot ran, in words; empty if one did.
    """

    ball_mm: float
    amplitude_um: float
    count: int
    sonotrode_count: int
    fit: SizeFit
    time_to_98: float | None
    is_of_places: bool
    intensity: PredictedIntensity | None
    harm: str


@dataclass(frozen=True)
class PoseTrial:
    """What a pilot told of a target in one pose, in its own chamber.

    Attributes:
        pose: its name, in words.
        sonotrode_count, settings: of sonotrodes side by side, and of the part one after the other.
        time_to_98, is_of_places, intensity: as of a BallTrial.
        outcome: "taken", or in words why it is not; "" if it is just slower.
    """

    pose: str
    sonotrode_count: int
    settings: int
    time_to_98: float | None
    is_of_places: bool
    intensity: PredictedIntensity | None
    outcome: str


@dataclass(frozen=True)
class Proposal:
    """A proposed design, the reason for each value, and the warnings of its check."""

    design: Design
    tables: Tables  # the values of the design file
    reasons: dict[str, str]  # of values, by dotted name
    bounds: dict[str, dict[str, Any]]  # of the study, as its file has them
    known: tuple[Surface, ...]  # surfaces to choose the target from
    mesh: PartMesh
    chamber: Chamber
    warnings: tuple[DesignWarning, ...]
    jams: tuple[JamGap, ...]  # gaps of chamber and part in which the balls jam
    sonotrode: ShopSonotrode  # whose face carries the chamber
    strips: Strips | None = None  # of which the target is one
    stance: Stance | None = None  # None until all of it is chosen
    # True if its chamber holds fewer balls than it should, as more take too long.
    is_capped: bool = False
    without_fillets: int = 0  # those of Wanted, to propose the same again
    thick_pose: Upright | None = None
    closed: tuple[str, ...] = ()  # sides at which a face of the part is the wall, such as "-x"
    # Of all replicas of a candidate [s], to know the time in which its target is covered; None if
    # no pilot ran, or balls do not touch enough of the target.
    search_time: float | None = None
    # Dents in a window that the peening strength takes, by a pilot; 0 if no intensity is wanted.
    strength_dents: float = 0.0
    predicted: PredictedIntensity | None = None  # by that pilot
    # Almen intensity of the proposal as it stands, and what is aimed at or is usual.
    expected: PredictedIntensity | None = None
    usual: WantedIntensity | None = None
    # Balls of several sizes that pilots compared, the smallest first; none without a pilot.
    trials: tuple[BallTrial, ...] = ()
    # Poses that pilots compared, in the order in which they were tried; none if one was quick.
    poses: tuple[PoseTrial, ...] = ()

    @property
    def leaves_end(self) -> bool:
        """Whether an end, or all beside a strip, is left out of the target."""
        stance = self.stance
        return bool(stance and stance.end and stance.end.target is not stance.target)

    @property
    def settings(self) -> int:
        """In how many settings of the part all of the target is peened, one after the other."""
        return 1 if self.strips is None else self.strips.settings

    @property
    def sonotrode_count(self) -> int:
        """How many sonotrodes side by side carry the chamber."""
        face = self.design.sonotrode.face
        return 1 if face is None else face.count


def checked(
    tables: Tables,
    reasons: dict[str, str],
    floor: Floor,
    known: Sequence[Surface],
    mesh: PartMesh,
    shop: Shop | None,
    beside: Proposal | None = None,
) -> Proposal:
    """Choose the mass of the balls for these values, and return the built and checked proposal.

    Raises:
        InputError: the chamber would be too large or cannot be built.
        HarmError: what is seen at once, before it is known where the shot reaches, is harm that
            the proposal `beside` does not do.

    Args:
        tables: tables of the design file. Their mass of the balls is replaced.
        reasons: reason for each value, by dotted name.
        floor: sizes of the chamber, from which the ranges of the study follow.
        known: surfaces to choose the target from.
        mesh: the part.
        shop: the shop in whose bounds the study stays, if it is known.
        beside: a proposal that is kept if this one does harm; None to check it in any case.
    """
    sizes = floor.sizes
    largest = max(size for key, size in tables["chamber"].items() if key.endswith("_mm"))
    if largest > LARGEST_MM:
        text = f"the part measures {format_box(mesh.size)}, too much for a chamber: it would need"
        most = f"{largest:g} mm, and {LARGEST_MM:g} mm are the most"
        raise InputError(f"{text} {most}; check --unit, or cut the part down to what is peened")
    design = validate(Design, nested(tables))
    chamber = build_chamber(design)
    diameter, ball_mass = design.shot.diameter, design.shot.ball_mass
    charge = propose_charge(sonotrode_area(chamber), diameter, ball_mass)
    mass_g = charge.mass_g
    tables = {**tables, "shot": {**tables["shot"], "mass_g": mass_g}}
    tables["tolerances"] = propose_tolerances(tables)
    design = validate(Design, nested(tables))
    in_words = {"shot.mass_g": f"{charge.reason}: {design.shot.count}", "tolerances": OF_LENGTHS}
    if charge.is_capped:
        full_g = float(f"{1e3 * charge.full * ball_mass:.2g}")
        in_words["shot.mass_g"] += (
            f"; {MatterKind.CHARGE_CUT} for the simulation, which takes hours with more: half a "
            f"layer is {charge.full:,} balls, {full_g:g} g, and a shop takes it (shot.mass_g)"
        )
    if beside is not None and not chamber.steps:
        at_once = first_warnings(design, chamber, chamber_mesh(chamber))
        if harm := _first_new(at_once, beside):
            raise HarmError(harm)
    found = tuple(warnings(design, chamber))
    if math.isinf(floor.lean):
        found = (DesignWarning(WarningKind.WIDE_FLOOR, f"chamber: {floor.reason}"), *found)
    ranges = propose_ranges(sizes, mass_g, 1e3 * diameter, ball_mass, floor.is_raised)
    if floor.is_low:
        del ranges["chamber.height_mm"]
    return Proposal(
        design=design,
        tables=tables,
        reasons={**reasons, **in_words},
        bounds=holding(_in_shop({k: one._asdict() for k, one in ranges.items()}, shop), design),
        known=tuple(known),
        mesh=mesh,
        chamber=chamber,
        warnings=found,
        jams=tuple(jam_gaps(chamber, diameter, gaps_in_reach(shot_reach(design, chamber)))),
        sonotrode=floor.stand.sonotrode,
        strips=floor.strips,
        closed=sizes.closed,
        is_capped=charge.is_capped,
    )


def sonotrode_area(chamber: Chamber) -> float:
    """Return the area of a chamber's first sonotrode [m²]."""
    area = areas(chamber.vertices, chamber.triangles)
    return float(area[chamber.tags == TAG_SONOTRODE].sum())


def with_charge(made: Proposal, factor: float) -> Proposal:
    """Return a proposal whose balls have a multiple of its mass, at most what is supported."""
    ball_mass = made.design.shot.ball_mass
    mass_g = float(f"{min(factor * made.tables['shot']['mass_g'], _heaviest_g(ball_mass)):.2g}")
    design = made.design.changed({"shot.mass_g": mass_g})
    return replace(
        made,
        design=design,
        tables={**made.tables, "shot": {**made.tables["shot"], "mass_g": mass_g}},
        bounds={**made.bounds, "shot.mass_g": _masses(mass_g, ball_mass)._asdict()},
        warnings=warned_again(made, design, made.chamber),
    )


def warned_again(made: Proposal, design: Design, chamber: Chamber) -> tuple[DesignWarning, ...]:
    """Return the warnings of a proposal whose design or chamber is changed.

    That its floor is wider than any sonotrode, no design tells.
    """
    of_floor = (one for one in made.warnings if one.kind == WarningKind.WIDE_FLOOR)
    return (*of_floor, *warnings(design, chamber))


def faults(made: Proposal) -> tuple[int, int]:
    """Return how many gaps of a proposal jam balls, and how many warnings it has."""
    return len(made.jams), len(made.warnings)


def new_harm(made: Proposal, before: Proposal) -> DesignWarning | None:
    """Return a warning of harm that a proposal does and another one does not; None if none.

    A warning that holds in both steps, at another place in each, is no new one. Nor is a gap that
    jams balls in the place of another one. That balls do not get to some of the target is no harm:
    it counts in what they serve and touch.
    """
    if harm := _first_new(made.warnings, before):
        return harm
    if len(made.jams) > len(before.jams):
        return DesignWarning(WarningKind.JAM, "balls jam in a gap")
    return None


def _first_new(found: Iterable[DesignWarning], before: Proposal) -> DesignWarning | None:
    """Return the first of some warnings that counts as harm and that a proposal does not have."""
    known = {one.subject for one in before.warnings}
    return next(
        (one for one in found if one.kind not in COUNTED and one.subject not in known), None
    )


def touched_share(made: Proposal) -> float:
    """Return the share of the target's area that the balls can touch."""
    part = made.chamber.part
    return touched_area(made) / float(part.area[part.target].sum())


def touched_area(made: Proposal) -> float:
    """Return the area of the target that the balls can touch [m²]."""
    part, share = made.chamber.part, touched(made.design, made.chamber)
    return float(share[part.target] @ part.area[part.target])


def propose_tolerances(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Return how far heights in the chamber and the amplitude may lie off, by dotted name.

    Args:
        tables: tables of the design file.
    """
    lengths = {key: tables["chamber"][key] for key in LENGTHS}
    found = {f"chamber.{key}": iso_2768_m(one) for key, one in lengths.items()}
    set_ = {key: one for key, one in OF_AMPLITUDE.items() if key in tables["sonotrode"]}
    return found | {f"sonotrode.{key}": one for key, one in set_.items()}


class Range(NamedTuple):
    """The range in which a study varies a number, in its unit, and the step between values."""

    low: float
    high: float
    step: float


class Charge(NamedTuple):
    """The proposed mass of all balls together."""

    mass_g: float  # to two digits
    reason: str
    # Balls of half a layer if the proposed mass is less, as more take too long; else 0.
    full: int = 0

    @property
    def is_capped(self) -> bool:
        """Whether it is less than it should be, as more take too long."""
        return self.full > 0


def propose_charge(floor: float, diameter: float, ball_mass: float) -> Charge:
    """Return the proposed charge of a chamber.

    Args:
        floor: area of the sonotrode [m²].
        diameter, ball_mass: diameter [m] and mass [kg] of a ball.
    """
    full = round(charge_of(floor, diameter))
    count = max(1, min(full, MOST_BALLS))
    wanted, most = 1e3 * count * ball_mass, _heaviest_g(ball_mass)
    if wanted > most:
        return Charge(most, "the most that is supported, less than half a layer of balls")
    mass = min(float(f"{wanted:.2g}"), most)
    if count < full:
        return Charge(mass, "less than half a layer of balls", full)
    return Charge(mass, "half a layer of balls on the sonotrode")


def propose_ranges(
    sizes: Sizes, mass_g: float, ball_mm: float, ball_mass: float, is_raised: bool = False
) -> dict[str, Range]:
    """Return the range of each number that the proposed study varies, by dotted name.

    Args:
        sizes: sizes of the chamber.
        mass_g: mass of all balls together.
        ball_mm: ball diameter.
        ball_mass: mass of one ball [kg].
        is_raised: whether nearer to the sonotrode its face would hit what is outside of the walls.
    """
    distance, height = round(1e3 * sizes.distance), round(1e3 * sizes.height)
    # Where the part is held outside, the ceiling stays near the place at which it goes out.
    least, most_mm = (
        (0.75, height + round(0.25 * distance)) if sizes.through_ceiling else (0.4, LARGEST_MM)
    )
    near = distance if is_raised else max(round(least * distance), math.ceil(2.0 * ball_mm))
    # The ceiling stays above the part even when the part is highest, so that no ball is caught.
    under = math.floor(height - 1e3 * sizes.top - 2.0 * ball_mm)
    far = max(distance, min(round(1.25 * distance), under))
    low = math.ceil(far + 1e3 * sizes.top + 2.0 * ball_mm)
    high = min(round(1.5 * height), most_mm)
    return {
        "chamber.height_mm": _lengths(min(low, height), high),
        "chamber.sonotrode_distance_mm": _lengths(min(near, distance), far),
        "shot.mass_g": _masses(mass_g, ball_mass),
    }


def _masses(mass_g: float, ball_mass: float) -> Range:
    """Return the range of the mass of all balls [g] round that of the first design.

    Args:
        ball_mass: mass of one ball [kg].
    """
    digit = _second_digit(mass_g)
    least, most = (digit * round(share * mass_g / digit) for share in (LIGHTER, HEAVIER))
    return Range(*(float(f"{x:.6g}") for x in (least, min(most, _heaviest_g(ball_mass)), digit)))


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


def holding(bounds: dict[str, dict[str, Any]], design: Design) -> dict[str, dict[str, Any]]:
    """Return the bounds of a study, widened where the design with which it starts is outside.

    What has no range then does not vary.
    """
    wide = {}
    for name, one in bounds.items():
        ends = {"low": min, "high": max} if "low" in one else {}
        now = design.value(name)
        wide[name] = {**one, **{end: pick(one[end], now) for end, pick in ends.items()}}
    return {name: one for name, one in wide.items() if "low" not in one or one["low"] < one["high"]}


def _in_shop(bounds: dict[str, dict[str, Any]], shop: Shop | None) -> dict[str, dict[str, Any]]:
    """Return the bounds of a study within what a shop has: its standard heights, its largest."""
    name, bounds = "chamber.height_mm", dict(bounds)
    if shop is None or name not in bounds:
        return bounds
    low, high = bounds[name]["low"], bounds[name]["high"]
    if shop.heights_mm:
        heights = sorted({one for one in shop.heights_mm if low <= one <= high})
        bounds[name] = {"choose": heights}
        if len(heights) < 2:
            del bounds[name]
    elif shop.largest_chamber_mm is not None:
        bounds[name]["high"] = min(high, math.floor(shop.largest_chamber_mm[2]))
    return bounds


def nested(tables: Tables) -> dict[str, object]:
    """Return tables with dotted names, such as "part.target", as tables inside each other."""
    nested: dict[str, Any] = {}
    for name, values in tables.items():
        table = nested
        for key in filter(None, name.split(".")):  # "" is the file's top, above all tables
            table = table.setdefault(key, {})
        table.update(values)
    return nested


def with_table(tables: Tables, after: str, name: str, values: dict[str, Any]) -> Tables:
    """Return tables with one more after that of some name."""
    added: Tables = {}
    for key, one in tables.items():
        added |= {key: one, name: values} if key == after else {key: one}
    return added
