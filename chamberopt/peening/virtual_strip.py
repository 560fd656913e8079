"""Peen a virtual strip, and give its arc heights, intensity and saturation time with intervals.

Notation: as in strip.py, and
    K, beta   arc height over h [mm/mm], dents on a real strip over simulated dents; 1 where the
              design is not calibrated
    H(t)      arc height of a real strip, K h(beta t); its saturation time is T / beta

The errors of a calibration widen the intervals of the figures. The slopes of a figure by the
logarithms of amplitude, restitution, yield speed and friction come from simulations with the same
seeds (calibration_errors.py). The slopes by K and beta come from the formula of H.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import FIRST_OF_CALIBRATION
from chamberopt.common.number_text import plain
from chamberopt.design.almen_strip import OVER_A, usual_strip
from chamberopt.design.calibration import TIME_ERROR, calibrated_strip
from chamberopt.peening.calibration_errors import moved_designs, slope
from chamberopt.peening.kirk_fit import (
    MULTIPLES,
    KirkFit,
    StripSaturation,
    heights,
    kirk_fits,
    strip_saturation,
)
from chamberopt.peening.probes import impacts_of
from chamberopt.peening.strip import (
    ENOUGH_DENTS,
    Cells,
    StripDents,
    StripSize,
    strip_cells,
    strip_curve,
    surface_cells,
)
from chamberopt.peening.strip_holder import HOLDER_FILE, lies_along_y, strip_design
from chamberopt.simulation.effort import Effort
from chamberopt.simulation.replicas import Replica, ReplicaSetting, simulate_replicas
from chamberopt.simulation.resting_balls import resting_notes
from chamberopt.simulation.trapped_balls import trapped_notes
from chamberopt.simulation.variations import RunsProgress

if TYPE_CHECKING:
    from pathlib import Path

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.estimate import Estimate
    from chamberopt.common.progress import Progress
    from chamberopt.design.almen_strip import StripType
    from chamberopt.design.calibration import Parameter
    from chamberopt.design.load import Design

DRAWN = np.linspace(0.0, 4.5, 46)[1:]  # times of the curve, in units of T
MICROMETRES = 1e6
MIN_OPEN = 0.999  # share of the strip that must face the shot
ONLY_RATIOS = (
    "arc heights are strengths in micrometres before the machine's constant: only ratios between "
    "designs mean something"
)
GAUGED = (
    "places are weighed as a gauge with balls 31.75 mm and 15.87 mm apart does: bending along the "
    "strip counts for 80 %"
)
EVEN = "all places count evenly: how the gauge for this size weighs them is not known"
FITS = (
    "curves fitted to five points find the intensity better than the saturation time: trust the "
    "intensity, not the time"
)
OF_A_ZONE = (
    "the part stays as it is, with its own restitution; the dents are those that a strip would get"
)


class StripSetting(NamedTuple):
    """Where and how a virtual strip is peened: the chamber, the strip's position and its cells.

    Attributes:
        design: design in which the strip is peened.
        type: type of the strip, as N, A or C.
        place: where the strip is, in words.
        cells: pieces of the strip in which dents are counted.
        notes: sentences for the user on the weights of the strip's points in the arc height.
    """

    design: Design
    type: StripType
    place: str
    cells: Cells
    notes: tuple[str, ...]


@dataclass(frozen=True)
class VirtualStrip:
    """Simulated arc heights, intensity and saturation time of a strip; heights are in `unit`."""

    setting: StripSetting
    unit: str
    intensity: Estimate  # the arc height at the saturation time
    time: Estimate  # saturation time [s]
    at: np.ndarray  # times of `heights` [s], (5,)
    heights: list[Estimate]  # after MULTIPLES of the saturation time
    drawn_at: np.ndarray  # times of `drawn` [s], ascending
    drawn: list[Estimate]  # the saturation curve
    fits: tuple[KirkFit, KirkFit]  # of two and of three parameters, through `heights`
    notes: tuple[str, ...]

    @property
    def is_calibrated(self) -> bool:
        """Whether the machine is calibrated, so that a real strip would get these arc heights."""
        return bool(self.of)

    @property
    def of(self) -> str:
        """Name of the real strip that would get these arc heights; "" without a calibration."""
        calibration = self.setting.design.calibration
        return calibration.strips if calibration and calibration.has_strips else ""


def strip_in_lid(
    design: Design,
    strip_type: StripType,
    size: StripSize,
    folder: Path,
    distance_mm: float | None = None,
) -> StripSetting:
    """Return where and how to peen a strip that is flush in a lid on the design's chamber.

    Args:
        folder: folder for the mesh of the lid.
        distance_mm: distance from the sonotrode to the strip; None: as far as the part.

    Raises:
        InputError: the chamber has a shape without a lid, or the strip does not fit into it.
    """
    changed = strip_design(design, size, folder, distance_mm)
    distance = changed.chamber.sonotrode_distance_mm
    along_y = lies_along_y(changed, size)
    along = ", along y" if along_y else ""
    place = f"{size}{along}, flush in a lid {distance:g} mm over the sonotrode"
    notes = (GAUGED if size.is_whole else EVEN,)
    return StripSetting(changed, strip_type, place, strip_cells(size, along_y), notes)


def strip_in_zone(
    design: Design, strip_type: StripType, zone: str, chamber: Chamber
) -> StripSetting:
    """Return where and how to peen a strip that is imagined on a zone of the part.

    The part stays as it is: its zone only counts the dents that a strip would get there.

    Args:
        chamber: chamber of the design.
    """
    part = chamber.part
    cells = surface_cells(
        part.vertices, part.triangles, np.where(part.zones[zone], chamber.exposed_area, 0.0)
    )
    return StripSetting(design, strip_type, f"in the place of {zone}", cells, (EVEN, OF_A_ZONE))


def peen_strip(
    setting: StripSetting, chamber: Chamber, executor: Executor, progress: Progress | None = None
) -> VirtualStrip:
    """Simulate the peening of a strip, and return its arc heights and intensity with intervals.

    Args:
        chamber: chamber of the setting's design.

    Raises:
        InputError: no impact dents the strip, or something in the chamber covers a part of it.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    design = setting.design
    _require_bare(chamber)
    mesh = chamber_mesh(chamber)
    moves = moved_designs(design)
    of_all = RunsProgress(progress, 1 + len(moves))
    replicas, dents, first, note = _simulated(
        ReplicaSetting(design, chamber, mesh), setting.cells, executor, of_all
    )
    at, drawn_at = (np.multiply(one, first.time.value) for one in (MULTIPLES, DRAWN))
    found = [*first, *heights(dents, [*at, *drawn_at])]
    slopes: list[dict[Parameter, float]] = [{} for _ in found]
    for name, step, moved in moves:
        of_all.ended += 1
        setting_of_moved, as_many = ReplicaSetting(moved, chamber, mesh), range(len(replicas))
        again = simulate_replicas(setting_of_moved, executor, of_all, as_many)
        other_dents = impacts_of(moved, again).strip_dents(setting.cells)
        others = [*strip_saturation(other_dents), *heights(other_dents, [*at, *drawn_at])]
        for of_one, one, other in zip(slopes, found, others, strict=True):
            of_one[name] = slope(one, other, step)
    intensity, time, *rest = _as_measured(setting, dents, found, slopes, [*at, *drawn_at])
    points, drawn = rest[: len(at)], rest[len(at) :]
    slower = time.value / first.time.value
    why_not = design.why_no_intensity
    return VirtualStrip(
        setting=setting,
        unit=_unit(setting),
        intensity=intensity,
        time=time,
        at=slower * at,
        heights=points,
        drawn_at=slower * drawn_at,
        drawn=drawn,
        fits=kirk_fits(slower * at, np.array([one.value for one in points])),
        notes=(  # what makes the numbers wrong, what they mean, and how they were found
            *_few_dents(dents),
            *((note,) if note else ()),
            *((why_not, ONLY_RATIOS) if why_not else _calibrated_notes(setting, intensity.value)),
            *setting.notes,
            FITS,
            *resting_notes([one.resting for one in replicas if one.resting], len(replicas)),
            *trapped_notes([one.trapped for one in replicas], design),
        ),
    )


def _simulated(
    setting: ReplicaSetting, cells: Cells, executor: Executor, progress: Progress
) -> tuple[list[Replica], StripDents, StripSaturation, str]:
    """Simulate the replicas that a strip takes.

    With process.accuracy.objective_half_width there are as many as give the arc height at the
    saturation time that half-width, as a share of it, by their scatter.

    Args:
        cells: pieces of the strip in which dents are counted.
    Returns:
        The replicas, their dents, arc height and time of saturation, and a note on how many
        replicas there are, "" if the design gives their number.
    """
    effort, replicas = Effort.of(setting.design.process.accuracy), list[Replica]()
    step = effort.begin
    while True:
        more = range(len(replicas), step.replicas)
        replicas += simulate_replicas(setting, executor, progress, more)
        dents = impacts_of(setting.design, replicas).strip_dents(cells)
        found = strip_saturation(dents)
        if found.time.value <= 0.0:
            raise _without_dents(setting.design, replicas)
        height = found.strength.times(1.0 / found.strength.value)
        step = effort.after(len(replicas), height, math.inf, step)
        if step.stopped_by:
            note = f"arc height at saturation, as a share of it: {step.note}" if step.note else ""
            return replicas, dents, found, note


def _require_bare(chamber: Chamber) -> None:
    """Raise InputError if something covers a part of the strip in a lid."""
    part = chamber.part
    if part.name != HOLDER_FILE:
        return
    open_area = float(chamber.exposed_area[part.target].sum() / part.area[part.target].sum())
    if open_area < MIN_OPEN:
        raise InputError(
            f"chamber: only {open_area:.0%} of the strip face the shot; move the deflectors away "
            "from the lid, or give --distance-mm"
        )


def _as_measured(
    setting: StripSetting,
    dents: StripDents,
    found: list[Estimate],
    slopes: list[dict[Parameter, float]],
    times: list[float],
) -> list[Estimate]:
    """Convert simulated figures of a strip to those of a real strip, with the calibration's errors.

    Args:
        found: the figures: arc height at the saturation time, the saturation time, and arc heights
            at `times`.
        slopes: for each figure its slope by each parameter of the calibration, from simulations
            with this parameter changed.
        times: peening times of the arc heights [s].
    """
    calibration = setting.design.calibration
    scale, slower = MICROMETRES, 1.0
    if calibration is not None and calibration.has_strips:
        scale = OVER_A[setting.type] * calibration.intensity_mmA(MICROMETRES)
        slower = 1.0 / calibration.factor("beta")
    scales = [scale, slower, *[scale] * len(times)]
    figures = [one.times(by) for one, by in zip(found, scales, strict=True)]
    if calibration is None:
        return figures
    growth = scale * strip_curve(dents).growth(np.array(times))
    by_beta = [0.0, -figures[1].value, *growth.tolist()]
    by_k = [1.0, 0.0, *[1.0] * len(times)]
    measured = []
    for k, (figure, by_run) in enumerate(zip(figures, slopes, strict=True)):
        whole: dict[Parameter, float] = {name: scales[k] * one for name, one in by_run.items()}
        whole |= {"K": by_k[k] * figure.value, "beta": by_beta[k]}
        of_model = TIME_ERROR * figure.value if k == 1 else 0.0
        measured.append(
            figure.with_shared(FIRST_OF_CALIBRATION, calibration.errors(whole, of_model))
        )
    return measured


def _unit(setting: StripSetting) -> str:
    """Return the unit of the arc heights.

    It is µm without a calibration, and mmA (or N, C) if the calibration measured standard strips.
    It is mm if the calibration measured strips of another size.
    """
    calibration = setting.design.calibration
    if calibration is None or not calibration.has_strips:
        return "µm"
    return "mm" if calibration.not_mmA else f"mm{setting.type}"


def _calibrated_notes(setting: StripSetting, height: float) -> tuple[str, ...]:
    """Return notes for the user: which strip gets these arc heights, and which type suits better.

    Args:
        height: Almen intensity, in mm of the strip's type (N, A or C).
    """
    calibration, strip_type = setting.design.calibration, setting.type
    assert calibration is not None
    text = f"arc heights are those of a {calibration.strips} that is peened like this"
    if calibration.not_mmA:
        return (f"{text}, with which the machine was calibrated: mm, not mm{strip_type}",)
    on_a = height / OVER_A[strip_type]
    better = usual_strip(on_a)
    if better == strip_type:
        return (text,)
    return (
        text,
        f"the intensity is about {plain(on_a, 2)} mmA, where {better} strips are used: N below "
        "0.10 mmA (0.004 in), C above 0.61 mmA (0.024 in)",
    )


def _few_dents(dents: StripDents) -> tuple[str, ...]:
    total = int(dents.number.sum())
    if total >= 4 * ENOUGH_DENTS:
        return ()
    return (
        f"only {total} dents: below some {4 * ENOUGH_DENTS} intervals may be too narrow, and "
        "places of the strip are not told apart; raise process.accuracy.simulated_time_s",
    )


def _without_dents(design: Design, replicas: list[Replica]) -> InputError:
    fastest = max((float(one.hits.speed.max(initial=0.0)) for one in replicas), default=0.0)
    slowest = calibrated_strip(design.shot, design.calibration).v0_m_s
    return InputError(
        f"the shot leaves no dent on the strip: its fastest impact has {fastest:.2g} m/s, and "
        f"dents begin at {slowest:.2g} m/s; raise the amplitude of [sonotrode]"
    )
