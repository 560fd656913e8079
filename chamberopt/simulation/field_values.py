"""Compute figures in windows round points of the part, and figures of each of its triangles.

Notation
    places   points of the part's surface, with their normals
    window   disc of the surface round a place, in which dents and impacts are counted
    x   dent density of a window: its expected dented area over its area, at the treatment time
    y   x from the simulated dents, sum of k w_j; v the sum of (k w_j)², see coverage_intervals.py
    C   coverage, 1 - exp(-x)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TARGET
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import CONFIDENCE
from chamberopt.coverage.coverage_from_impacts import (
    coverage_from_dent_density,
    find_footprints,
    in_batches,
    locate_dents,
)
from chamberopt.coverage.field.surface_points import ball_fits, spread_within
from chamberopt.coverage.field.target_field import Gauge, with_whole_part
from chamberopt.coverage.strength import (
    LEVELS,
    area_of_dent,
    levels,
    saturated_strength,
    strip_dents,
)
from chamberopt.coverage.stress_knowledge import SURFACE
from chamberopt.coverage.stress_model import law_factors, stress_model
from chamberopt.coverage.stress_profile import (
    dented_by_size,
    depth_of_compression,
    layer_histograms,
    level_layers,
    share_by_level,
    surface_profile,
)
from chamberopt.design.calibration import calibrated_strip
from chamberopt.simulation.evaluate import prepare_target, rooms_of, zone_fields
from chamberopt.simulation.evaluation import require_triangles
from chamberopt.simulation.time_curve import coverage_against_time
from sim_core import TriangleMesh, closest_points

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.estimate import Estimate
    from chamberopt.coverage.field.display_mesh import DisplayField
    from chamberopt.coverage.field.smooth_faces import Places
    from chamberopt.coverage.field.windows import Windows
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.coverage.stress_profile import SurfaceProfile
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

POINTS_PER_WINDOW = 4  # points on an area of one window, for the values of a triangle
MAX_POINTS = 300_000
MAX_PAIRS = 10_000_000  # pairs of a window and a dent, of 12 bytes each, in memory at once
WIDEST = 0.5  # widest interval of a coverage that is drawn in a colour, about ± 25 %
HIGH_SPEED = 0.9  # share of the impacts that are not faster than p90_normal_speed


class _Portions:
    """Divides dents into slices whose pairs of a dent and a window fit into memory.

    The first slice would fit if each of its dents were in all windows. The next one is at most
    twice as large, and such that its pairs fit twice if it has as many a dent as the last.
    """

    def __init__(self, windows: int) -> None:
        self._step = self._least = max(1, MAX_PAIRS // max(windows, 1))

    def of(self, dents: int) -> Iterator[slice]:
        """Yield slices of all dents."""
        end = 0
        while end < dents:
            some = slice(end, min(end + self._step, dents))
            end = some.stop
            yield some

    def learn(self, some: slice, pairs: int) -> None:
        """Choose the size of the next slice by the number of pairs of one."""
        fits = (some.stop - some.start) * MAX_PAIRS // (2 * max(pairs, 1))
        self._step = max(self._least, min(2 * self._step, fits))


def _by_cells(hits: Hits, edge: float) -> Hits:
    """Return impacts in the order of cubic cells of this edge [m].

    Impacts of one cell fall into the same windows, whose figures then stay in the processor's
    cache. It saves a fifth of the time of all figures.
    """
    return hits.select(np.lexsort(np.floor(hits.place / edge).T))


class _Seen(NamedTuple):
    """What was seen in windows round some places: whether a ball fits there (p,), and the dents."""

    gauge: Gauge
    reachable: np.ndarray
    dents: dict[str, np.ndarray]  # as `PartField._dents` returns them


def _joined(seen: Sequence[_Seen], rows: np.ndarray, windows: Windows) -> _Seen:
    """Return what was seen in some of the windows of all portions, off creases.

    Args:
        rows: numbers of these windows, counted through all portions, (p,).
        windows: these windows, (p,).
    """
    area = np.concatenate([one.gauge.area for one in seen])[rows]
    reachable = np.concatenate([one.reachable for one in seen])[rows]
    names = seen[0].dents
    dents = {name: np.concatenate([one.dents[name] for one in seen])[rows] for name in names}
    return _Seen(Gauge(windows, area, None), reachable, dents)


class PartField:
    """Coverage and other figures at any points of the part, from the impacts of an evaluation."""

    def __init__(self, design: Design, chamber: Chamber, evaluation: Evaluation) -> None:
        self._design, self._chamber = design, chamber
        self._mesh = chamber_mesh(chamber)
        self.target = prepare_target(design, chamber, self._mesh)
        self._rooms = rooms_of(design, chamber, self._mesh)
        self.field = with_whole_part(self.target, chamber, self._rooms)
        self._hits = evaluation.hits
        self._in_sector = [
            _by_cells(self.field.in_sector(hits), self.field.radius) for hits in self._hits
        ]
        self._located = [locate_dents(self.field, hits) for hits in self._in_sector]
        self._simulated_time = evaluation.simulated_time
        # Treatment time over simulated time.
        self._scale = design.process.treatment_time / evaluation.simulated_time

    def reachable(self, places: Places) -> np.ndarray:
        """Return for each point of the surface whether the smallest ball fits there, (p,) bool."""
        return ball_fits(
            self._rooms, places.place, places.normal, 0.5 * min(self._design.shot.diameters)
        )

    def display(self) -> DisplayField:
        """Return the figures of `values` at the vertices of a mesh to draw, in single precision.

        Dents on creases do not count in the coverage. They cover a band as narrow as a dent, and a
        drawing would smear it over whole triangles.
        """
        from chamberopt.coverage.field.display_mesh import DisplayField, display_mesh

        part, asked, numbers = self._chamber.part, list[_Seen](), list[np.ndarray]()

        def coverage(places: Places) -> np.ndarray:
            rows, which = self.field.distinct(places)
            own, before = places.select(rows), sum(len(one.reachable) for one in asked)
            seen = self._seen(own, self._gauge_off_creases(own))
            asked.append(seen)
            numbers.append(before + which)
            density = seen.dents["dent_density"]
            found = np.where(seen.reachable, coverage_from_dent_density(density), np.nan)
            return np.asarray(found[which])

        mesh, asked_at = display_mesh(
            part.vertices, part.triangles, part.corner_normals, part.target, self.field.drawn_face,
            self.field.setting.gauge, coverage,
        )  # fmt: skip
        rows, which = self.field.distinct(mesh.places)
        windows = self.field.windows_round(mesh.places.select(rows), self.field.radius)
        seen = _joined(asked, np.concatenate(numbers)[asked_at[rows]], windows)
        values = self._values(seen, which) | self._moved(mesh.places)
        fields = {name: one.astype(np.float32) for name, one in values.items()}
        return DisplayField(replace(mesh, normal=mesh.normal.astype(np.float32)), fields)

    def _gauge_off_creases(self, places: Places) -> Gauge:
        return replace(self.field.gauge_round(places, self.field.radius), band=None)

    def _seen(self, places: Places, gauge: Gauge) -> _Seen:
        return _Seen(gauge, self.reachable(places), self._dents(gauge))

    def values(self, places: Places) -> dict[str, np.ndarray]:
        """Compute all figures in windows, discs of the surface round some points.

        Returns:
            Arrays (p,) by name; NaN where nothing was hit. Out of reach of the balls all but the
            first two are NaN.

            coverage: at the treatment time, 0..1; 0 out of reach.
            reachable: 1 where a ball fits, else 0.
            dent_density: expected dented area over the area of the window, x.
            coverage_interval: width of the 95 % interval of the coverage.
            dents_in_window: simulated dents.
            resolved: 1 where the coverage's interval is no wider than WIDEST, else 0.
            impacts_per_mm2, energy_per_mm2: impacts and energy [mJ] at the treatment time.
            mean_normal_speed, p90_normal_speed: mean and 90th percentile [m/s].
            mean_angle_deg: mean angle of the impacts [degrees]; 90 is head on.
            mean_dent_um: mean diameter of the dents [µm].
            strength_um, saturation_time_s: peening strength S [µm] and T, see coverage/strength.py.
            almen_intensity_mmA: [mmA]; only where the design has a calibration to strips.
            compression_depth_um: [µm], see coverage/stress_profile.py; absent for some metals.
            surface_stress_MPa: residual stress at the surface [MPa]; where the design asks for it.
            moved_um: distance of the surface from the file's facets [µm]; absent if none moved.
        """
        rows, which = self.field.distinct(places)
        own = places.select(rows)
        seen = self._seen(own, self.field.gauge_round(own, self.field.radius))
        return self._values(seen, which) | self._moved(places)

    def _values(self, seen: _Seen, which: np.ndarray) -> dict[str, np.ndarray]:
        """Return the figures of `values` but moved_um, (p,) by name.

        Args:
            seen: what was seen in windows round the distinct points.
            which: number of each point among the distinct points, (p,).
        """
        gauge, fits = seen.gauge, seen.reachable & np.isfinite(seen.gauge.area)
        found = seen.dents | self._impacts(gauge)
        known = {name: np.where(fits, column, np.nan) for name, column in found.items()}
        coverage = coverage_from_dent_density(found["dent_density"])
        enough = fits & (found["coverage_interval"] <= WIDEST)
        columns = {
            "coverage": np.where(fits, coverage, 0.0),
            "reachable": fits.astype(float),
            **known,
            "resolved": enough.astype(float),
        }
        return {name: column[which] for name, column in columns.items()}

    def stress_profiles(self, metrics: Mapping[str, Estimate]) -> dict[str, SurfaceProfile]:
        """Return the stress under the target and under each zone, by "the target" or its name.

        A surface whose stress is not told, for example because it is not covered, is left out. The
        result is empty if the design does not ask for stress.

        Args:
            metrics: those of the evaluation.
        """
        model, process, profiles = stress_model(self._design), self._design.process, {}
        if model is None:
            return {}
        zones = zone_fields(self._design, self._chamber, self._mesh)
        for name, surface in {TARGET: self.target, **zones}.items():
            figure = SURFACE if name == TARGET else f"{name}.{SURFACE}"
            if metrics[figure].in_words:
                continue
            batches = in_batches([surface.in_sector(hits) for hits in self._hits])
            seen = layer_histograms(surface, batches, process.recorded_time, model)
            found = surface_profile(seen, process.treatment_time)
            if found is not None:
                profiles[name] = found
        return profiles

    def _moved(self, places: Places) -> dict[str, np.ndarray]:
        """Return how far smoothing has moved the surface at each point [µm], named moved_um.

        The result is empty if the part is not smoothed.
        """
        part = self._chamber.part
        if part.smoothing is None or part.file is None or part.file.original is None:
            return {}
        given, size = part.file.original, float(np.ptp(part.vertices))
        vertices = given.vertices @ part.file.rotation.T + part.file.shift
        facets = TriangleMesh(vertices, given.triangles, np.zeros(len(given.triangles), np.uint8))
        return {"moved_um": 1e6 * closest_points(facets, places.place, size).distance}

    def element_values(self) -> dict[str, np.ndarray]:
        """Compute means of `values` over each triangle of the part, and counts of impacts on it.

        Returns:
            Arrays (m,) by name: the names of `values`, NaN where the triangle is not exposed, and

            impacts, dents: counts of simulated impacts and dents on the triangle.
            exposed_area_mm2, reachable_area_mm2: its areas in the cavity, and where a ball fits.
            target: whether the triangle belongs to the target.
            element: number of the triangle's element in the part's file.
            zone: number of the last zone with the triangle, from 1, or 0; zone_NAME: whether the
                zone NAME has the triangle. Both only where there are zones.
        """
        from chamberopt.coverage.field.smooth_faces import Places

        part, exposed = self._chamber.part, self._chamber.exposed_area > 0.0
        count = len(part.triangles)
        spread = spread_within(
            part.vertices,
            part.triangles,
            np.where(exposed, part.area, 0.0),
            self.field.setting.gauge / POINTS_PER_WINDOW,
            MAX_POINTS,
        )
        owner = spread.triangle
        normal = part.normals_at(owner, spread.place)
        values = self.values(Places(spread.place, normal, self.field.face[owner]))
        points = np.bincount(owner, minlength=count)
        means = {}
        for name, column in values.items():
            known = ~np.isnan(column)
            sums = np.bincount(owner[known], column[known], count)
            there = np.bincount(owner[known], minlength=count)
            means[name] = np.divide(sums, there, out=np.full(count, np.nan), where=there > 0)
        on = [np.bincount(hits.triangle, minlength=count) for hits in self._hits]
        dents = [
            np.bincount(hits.triangle[hits.dent > 0.0], minlength=count) for hits in self._hits
        ]
        reached = np.divide(
            np.bincount(owner, values["reachable"], count), points, out=np.zeros(count),
            where=points > 0,
        )  # fmt: skip
        return means | {
            "impacts": np.sum(on, axis=0),
            "dents": np.sum(dents, axis=0),
            "exposed_area_mm2": self._chamber.exposed_area * 1e6,
            "reachable_area_mm2": reached * part.area * 1e6,
            "target": part.target.astype(np.uint8),
            "element": part.elements,
            **self._zones(),
        }

    def _zones(self) -> dict[str, np.ndarray]:
        """Return for each triangle of the part the number of its last zone, and marks of each zone.

        They have the names `zone` and zone_NAME. The result is empty for a part without zones.
        """
        zones = self._chamber.part.zones
        if not zones:
            return {}
        last = np.zeros(len(self._chamber.part.triangles), dtype=np.uint8)
        for number, zone in enumerate(zones.values(), start=1):
            last[zone] = number
        return {"zone": last, **{f"zone_{k}": one.astype(np.uint8) for k, one in zones.items()}}

    def _dents(self, gauge: Gauge) -> dict[str, np.ndarray]:
        """Return by name each window's dent density, number of dents and coverage interval."""
        from chamberopt.coverage.field.windows import add_powers

        sums, largest = np.zeros((len(gauge.area), 3)), 0.0
        portions = _Portions(len(gauge.area))
        for hits, located in zip(self._hits, self._located, strict=True):
            for some in portions.of(len(located.edge)):
                found = find_footprints(self.field, gauge, located.select(some))
                add_powers(found.point, found.weight, sums)
                portions.learn(some, len(found.point))
            largest = max(largest, float(hits.dent.max(initial=0.0)))
        dents, share, squares = sums.T
        one_more = np.pi / 4.0 * largest**2 / gauge.area
        low, high = density_bounds(
            self._scale * share, self._scale**2 * squares, self._scale * one_more
        )
        return {
            "dent_density": self._scale * share,
            "coverage_interval": coverage_from_dent_density(high) - coverage_from_dent_density(low),
            "dents_in_window": dents,
        }

    def _impacts(self, gauge: Gauge) -> dict[str, np.ndarray]:
        """Return means and percentiles over the impacts in each window, by name.

        Impacts on creases, the sharp edges of the surface, count as well.
        """
        from chamberopt.coverage.field.windows import add_columns, add_to_levels

        points = len(gauge.area)
        shot, metal = self._design.shot, self._design.materials.part
        fastest = max(float(hits.speed.max(initial=0.0)) for hits in self._in_sector)
        # Impacts are sorted by speed, dents on a strip by strength, dents on the part by size.
        strip = calibrated_strip(shot, self._design.calibration)
        on_strip = [strip_dents(hits, shot.density, strip) for hits in self._in_sector]
        strongest = max(float(one.max(initial=0.0)) for _, one in on_strip)
        widest = max(float(hits.dent.max(initial=0.0)) for hits in self._in_sector)
        sums = np.zeros((points, 6))
        by_speed, by_strength, by_size = np.zeros((3, points, LEVELS))
        for hits, (strip_dent, strength) in zip(self._in_sector, on_strip, strict=True):
            ones, is_dent = np.ones(len(hits)), hits.dent > 0.0
            columns = np.stack(
                [ones, hits.speed, hits.angle, hits.energy, hits.dent, is_dent], axis=1, dtype=float
            )
            histograms = (
                (ones, levels(hits.speed, fastest), by_speed),
                (area_of_dent(strip_dent), levels(strength, strongest), by_strength),
                (area_of_dent(hits.dent.astype(float)), levels(hits.dent, widest), by_size),
            )
            for pair in gauge.windows.pairs(self.field.places_of(hits, np.arange(len(hits)))):
                add_columns(*pair, columns, sums)
                for histogram in histograms:
                    add_to_levels(*pair, *histogram)
        by_strength /= gauge.area[:, None]
        by_size /= gauge.area[:, None]
        impacts, speed, angle, energy, dent, dents = sums.T
        strength, time = saturated_strength(by_strength, strongest)
        found = {
            "impacts_per_mm2": self._scale * 1e-6 * _ratio(impacts, gauge.area),
            "energy_per_mm2": self._scale * 1e-3 * _ratio(energy, gauge.area),
            "mean_normal_speed": _ratio(speed, impacts),
            "p90_normal_speed": _quantile(by_speed, HIGH_SPEED) * fastest,
            "mean_angle_deg": _ratio(angle, impacts),
            "mean_dent_um": 1e6 * _ratio(dent, dents),
            "strength_um": 1e6 * strength,
            "saturation_time_s": np.where(time > 0.0, time * self._simulated_time, np.nan),
        }
        calibration = self._design.calibration
        if calibration is not None and calibration.has_strips:
            found["almen_intensity_mmA"] = calibration.intensity_mmA(1.0) * found["strength_um"]
            found["saturation_time_s"] /= calibration.factor("beta")
        return found if metal.hardens_strongly else found | self._layer(by_size, widest)

    def _layer(self, by_size: np.ndarray, widest: float) -> dict[str, np.ndarray]:
        """Return the depth of the compressed layer in each window and, where the design asks for
        it, the stress at the surface, by name.

        Args:
            by_size: dented area over area of each window, by level of dent diameter, (p, LEVELS).
            widest: dent diameter at the upper end of the levels [m].
        """
        share, model = share_by_level(by_size, self._scale), stress_model(self._design)
        depth = depth_of_compression(share.sum(axis=1), widest, law_factors(self._design))
        found = {"compression_depth_um": 1e6 * np.asarray(depth)}
        if model is not None and widest > 0.0:
            layers = level_layers(model, widest, dented_by_size([self._in_sector], widest, model))
            found["surface_stress_MPa"] = 1e-6 * (share @ layers.stress[:, 0])
        return found


def density_bounds(
    y: np.ndarray, v: np.ndarray, one_more: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper ends of the 95 % intervals of windows' dent densities, (p,) each.

    The dents of a window, a disc of the surface, fall as a Poisson process. The weight of a dent is
    its area in the window over the window's area. The gamma interval for the sum of such weights
    holds for few dents and for none. It does not hold for dents that follow each other because a
    ball bounces on one spot.

    Args:
        y: sum of the weights of the dents, (p,).
        v: sum of the squares of these weights, (p,).
        one_more: weight of a dent of the largest size, (p,).

    Source: M. P. Fay and E. J. Feuer, "Confidence intervals for directly standardized rates",
    Statistics in Medicine 16 (1997) 791.
    """
    from scipy.special import gammaincinv

    tail = 0.5 * (1.0 - CONFIDENCE)
    low = np.zeros(len(y))
    some = v > 0.0
    low[some] = v[some] / y[some] * gammaincinv(y[some] ** 2 / v[some], tail)
    # The upper end belongs to one more dent of the largest size.
    y, v = y + one_more, v + one_more**2
    high = np.full(len(y), np.inf)
    some = v > 0.0
    high[some] = v[some] / y[some] * gammaincinv(y[some] ** 2 / v[some], 1.0 - tail)
    return low, high


def _ratio(top: np.ndarray, bottom: np.ndarray) -> np.ndarray:
    return np.asarray(np.divide(top, bottom, out=np.full(len(top), np.nan), where=bottom > 0.0))


def _quantile(counts: np.ndarray, share: float) -> np.ndarray:
    """Return the quantile of each row of a histogram, as a share of its upper end, (p,).

    Args:
        counts: histograms, with LEVELS equal intervals from 0 on, (p, LEVELS).
        share: share of the counts that are below the quantile.
    """
    upto = np.cumsum(counts, axis=1)
    wanted = share * upto[:, -1]
    level = np.minimum((upto < wanted[:, None]).sum(axis=1), LEVELS - 1)
    rows = np.arange(len(counts))
    before = upto[rows, level] - counts[rows, level]
    inside = _ratio(wanted - before, counts[rows, level])
    return np.asarray((level + inside) / LEVELS)


@dataclass(frozen=True)
class CandidateResult:
    """A simulated candidate design, with the fields and curves that its result folder holds."""

    design: Design
    chamber: Chamber
    evaluation: Evaluation
    element_values: dict[str, np.ndarray]  # of each triangle of the part, by name, (m,) each
    display: DisplayField  # fields at the vertices of a mesh to draw
    time_curve: list[dict[str, float]]  # coverage against peening time, a row a time
    # Residual stress under the target and each zone, if the design asks for it.
    stress: dict[str, SurfaceProfile] = field(default_factory=dict)


def complete_result(design: Design, chamber: Chamber, evaluation: Evaluation) -> CandidateResult:
    """Compute the fields and curves of a final result; a search for a design does without these.

    Raises InputError if the evaluation is of another part, as may happen with a file of a resumed
    study.
    """
    require_triangles(evaluation, len(chamber.part.triangles))
    seen = PartField(design, chamber, evaluation)
    with ThreadPoolExecutor(2) as threads:  # compiled code runs beside other threads
        element_values = threads.submit(seen.element_values)
        display = threads.submit(seen.display)
        time_curve = coverage_against_time(design, seen.target, evaluation)
        return CandidateResult(
            design=design,
            chamber=chamber,
            evaluation=evaluation,
            element_values=element_values.result(),
            display=display.result(),
            time_curve=time_curve,
            stress=seen.stress_profiles(evaluation.metrics),
        )
