"""Write the data files of a result. A file that cannot be completed does not appear."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.checks.fillets import facets_are_left
from chamberopt.common.estimate import finite_or_none
from chamberopt.common.files import RESULT, make_folder, write_text
from chamberopt.common.versions import versions
from chamberopt.coverage.metrics import exposed_target
from chamberopt.coverage.part_impacts import HITS_FILE, save_hits, sort_hits_by_triangle
from chamberopt.coverage.stress_knowledge import stress_bands
from chamberopt.design.load import Design, save_design, with_paths_from
from chamberopt.peening.range_result import Spreads
from chamberopt.results.arrays_file import ResultArrays, save_result_arrays
from chamberopt.results.load import START, content_sha256, file_sha256
from chamberopt.results.records import (
    FORMAT,
    Accuracies,
    AccuracyRecord,
    AdviceRecord,
    BestRecord,
    CandidateRecord,
    ChamberRecord,
    ConfirmedRecord,
    CoverageAtTime,
    FieldRecord,
    FixtureRecord,
    FrontPoint,
    ModelRecord,
    Needed,
    Objective,
    ProfileRecord,
    ResultRecord,
    SliceRecord,
    StartRecord,
    StressRecord,
    StudyRecord,
    SweepFacts,
    SweepRecord,
    TrappedRecord,
    ViolationRecord,
    ZoneLimit,
    ZoneRecord,
)
from chamberopt.results.vtp_files import write_chamber, write_coverage
from chamberopt.search import pareto
from chamberopt.search.study.constraints import judge_zones
from chamberopt.search.trial_log import read_seconds, trials_as_csv
from chamberopt.simulation.field_values import CandidateResult

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.peening.range_result import RivalAtEnds, StudyRanges
    from chamberopt.search.run_study import StudyResult
    from chamberopt.search.run_sweep import SweepResult
    from chamberopt.search.sensitivity import Sensitivity
    from chamberopt.search.trial_log import Trial
    from chamberopt.simulation.advice import Advice
    from chamberopt.simulation.evaluation import Evaluation

NO_SPREADS = Spreads()


def write_simulation(
    folder: Path, candidate: CandidateResult, spreads: Spreads = NO_SPREADS
) -> CandidateRecord:
    """Write the data files of a simulation into an empty folder and return its record."""
    save_design(candidate.design, folder / "design.toml")
    more = {name: one for name, one in spreads._asdict().items() if one}
    return _write_candidate(folder, candidate, kind="simulation", **more)


def write_study(
    folder: Path,
    study_result: StudyResult,
    start: CandidateResult,
    best: CandidateResult,
    ranges: StudyRanges | None = None,
) -> CandidateRecord:
    """Add the data files of a finished study to its folder.

    run_study has written design.toml, study.toml and history.jsonl. write_study adds best.toml,
    history.csv and, for two objectives, pareto.csv. It adds coverage.vtp, part.vtp, hits.npz,
    arrays.npz, chamber.stl and chamber.vtp of the best design. The folder start/ is the
    results folder of the design with which the study began, simulated on the same seeds.

    Returns:
        The study's record, which `write_result` writes.
    """
    save_design(best.design, folder / "best.toml")
    write_text(folder / "history.csv", trials_as_csv(study_result.trials, read_seconds(folder)))
    own = make_folder(folder / START)
    write_result(own, write_simulation(own, start, Spreads(ranges=ranges and ranges.start)))
    if study_result.study.objective.pareto:
        write_text(folder / "pareto.csv", pareto.as_csv(study_result))
    more = {"ranges": ranges.best} if ranges else {}
    record = study_record(study_result, ranges.rivals if ranges else ())
    return _write_candidate(folder, best, kind="study", study=record, **more)


def write_sweep(folder: Path, sweep: SweepResult) -> SweepRecord:
    """Add the data files of a finished sweep to its folder and return its record.

    run_sweep has written design.toml, study.toml and history.jsonl. write_sweep adds history.csv
    and, if a candidate meets the constraints, best.toml.
    """
    write_text(folder / "history.csv", trials_as_csv(sweep.trials, read_seconds(folder)))
    if sweep.best is not None:
        save_design(sweep.study.design.changed(sweep.best.parameters), folder / "best.toml")
    return _about_sweep(sweep)


def best_row_note(sweep: SweepResult) -> str:
    """Return a note on a sweep's best candidate.

    It says that the best candidate's figures are too good, because it is partly the luckiest. If no
    candidate meets the constraints, it says so.
    """
    if sweep.best is None:
        return (
            "no candidate meets the constraints, so there is no best.toml: loosen the constraints "
            "or widen [vary]"
        )
    return (
        f"the best of {len(sweep.trials)} candidates is also the luckiest, so its figures are too "
        "good; for figures without this bias simulate best.toml with another process.seed, or "
        "search with chamberopt run"
    )


def write_result(
    folder: Path,
    record: ResultRecord,
    advice: Sequence[Advice] = (),
    warned: Sequence[str] | None = None,
) -> None:
    """Write result.json, the file that makes a folder a finished result.

    Args:
        folder: folder of the result.
        record: record from write_simulation, write_study or write_sweep.
        advice: reasons for the physical effects, if the design left their choice to the program.
        warned: warnings of `chamberopt check`; None if it was not run.
    """
    more: dict[str, Any] = {"files": data_digests(folder)}
    if advice:
        more["effects"] = [advice_record(one) for one in advice]
    if warned is not None:
        more["warnings"] = list(warned)
    data = record.model_copy(update=more).as_json()
    data["sha256"] = content_sha256(data)
    write_text(folder / RESULT, json.dumps(data, indent=2, allow_nan=False) + "\n")


def advice_record(advice: Advice) -> AdviceRecord:
    """Return advice on an optional physical effect in the form in which result.json stores it."""
    return AdviceRecord(
        effect=advice.effect,
        on=advice.on,
        verdict=advice.verdict,
        said=str(advice),
        changes=advice.changes,
    )


def data_digests(folder: Path) -> dict[str, str]:
    """Return the sha256 digest of each data file of a results folder, by name.

    Pictures are left out, because no code reads them.
    """
    files = (one for one in sorted(folder.iterdir()) if one.is_file())
    skipped = RESULT, ".png"
    return {
        one.name: file_sha256(one)
        for one in files
        if not one.name.startswith(".") and not one.name.endswith(skipped)
    }


def _write_candidate(folder: Path, candidate: CandidateResult, **more: Any) -> CandidateRecord:
    """Write the surfaces and impacts of a simulated design into a folder.

    Return the record for result.json, with the further keys `more`.
    """
    design, chamber, evaluation = candidate.design, candidate.chamber, candidate.evaluation
    arrays = ResultArrays(chamber, candidate.element_values, candidate.display)
    save_result_arrays(folder, arrays)
    write_coverage(folder, arrays.part, arrays.field)
    hits = sort_hits_by_triangle(evaluation.hits, len(chamber.part.triangles))
    save_hits(folder / HITS_FILE, hits)
    write_chamber(folder, chamber)
    target = exposed_target(chamber)
    if design.zones:
        more["zones"] = _about_zones(design, chamber, evaluation)
    if evaluation.steps:
        more["steps"] = evaluation.steps
    if design.stress:
        more["stress"] = _about_stress(design, candidate)
    if chamber.shape_sha256:
        more["shape_sha256"] = chamber.shape_sha256
    return CandidateRecord(
        format=FORMAT,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        objective=Objective(name=evaluation.objective_name, estimate=evaluation.objective),
        metrics=evaluation.metrics,
        field=_about_field(design, evaluation),
        coverage_against_time=[CoverageAtTime(**row) for row in candidate.time_curve],
        seed=design.process.seed,
        stream=evaluation.stream,
        replicas=evaluation.replicas,
        stopped_by=evaluation.stopped_by,
        analytic=evaluation.analytic,
        simulated_time_s=evaluation.simulated_time,
        collisions=evaluation.collisions,
        timings_s={step: round(seconds, 3) for step, seconds in evaluation.timings.items()},
        trapped=TrappedRecord(**asdict(evaluation.trapped)) if evaluation.trapped else None,
        first_half_excess=evaluation.first_half_excess,
        chamber=ChamberRecord(
            volume_mm3=chamber.volume * 1e9,
            target_exposed_area_mm2=float(chamber.exposed_area[target].sum() * 1e6),
            target_triangles=int(target.sum()),
            pieces_in_air=chamber.pieces_in_air,
            facets_left=facets_are_left(chamber.part),
            **_about_fixtures(chamber),
        ),
        notes=[*evaluation.notes, *chamber.notes],
        design=_design_values(design, folder),
        part_sha256=chamber.part.sha256,
        part_unit=chamber.part.unit,
        files={},  # filled in when all files are written
        versions=versions(),
        **more,
    )


def _about_fixtures(chamber: Chamber) -> dict[str, Any]:
    """Return the record of holder and mask under its key. It is empty without them."""
    fixtures = {
        name: FixtureRecord(
            kind=one.kind,
            size_mm=[1e3 * side for side in one.size],
            length_mm=1e3 * one.length,
            covered_mm2=1e6 * one.covered,
            covered_target_mm2=1e6 * one.covered_target,
            **({"place_mm": [1e3 * x for x in one.place]} if one.place else {}),
        )
        for name, one in chamber.fixtures.items()
    }
    return {"fixtures": fixtures} if fixtures else {}


def _about_stress(design: Design, candidate: CandidateResult) -> StressRecord:
    """Return the record of the residual stress that a design asks for."""
    assert design.stress is not None
    profiles = {
        name: ProfileRecord(**{key: x[np.isfinite(x)].tolist() for key, x in one._asdict().items()})
        for name, one in candidate.stress.items()
    }
    return StressRecord(
        thickness_mm=design.stress.thickness_mm,
        peened=design.stress.peened,
        bands=stress_bands(design),
        profiles=profiles,
    )


def _about_zones(design: Design, chamber: Chamber, evaluation: Evaluation) -> list[ZoneRecord]:
    """Return the records of the part's zones, with their limits and whether they are met.

    Coverage of the zones is not in these records but among the metrics.
    """
    judged = judge_zones(design, evaluation.metrics)
    return [
        ZoneRecord(
            name=name,
            triangles=int(zone.sum()),
            exposed_area_mm2=float(chamber.exposed_area[zone].sum() * 1e6),
            reachable_share=evaluation.zones[name],
            limits=[ZoneLimit(**row) for row in judged[name]],
        )
        for name, zone in chamber.part.zones.items()
    ]


def _about_field(design: Design, evaluation: Evaluation) -> FieldRecord:
    """Return the record of the windows in which coverage is measured.

    Windows are discs of the surface. The record also has metrics from windows of twice the width.
    """
    found = evaluation.resolution
    return FieldRecord(
        gauge_mm2=design.process.accuracy.gauge_mm2,
        points=design.process.accuracy.points,
        dents_in_median_window=found.dents,
        dents_needed=Needed(
            mean_and_std=found.needed_for_mean, p05_times_intensity=found.needed_for_places
        ),
        simulated_s_needed=Needed(
            mean_and_std=finite_or_none(found.time_for(found.needed_for_mean)),
            p05_times_intensity=finite_or_none(found.time_for(found.needed_for_places)),
        ),
        reachable_share=evaluation.reachable,
        crease_share=evaluation.crease_share,
        alike_places=evaluation.alike,
        double_gauge=evaluation.metrics_of_wide,
    )


def study_record(result: StudyResult, at_ends: Sequence[RivalAtEnds] = ()) -> StudyRecord:
    """Return the key `study` of result.json for a finished study.

    Args:
        at_ends: comparisons of the best design with others at the ends of what is not calibrated.
    """
    study, replicas = result.study, result.best.evaluation.replicas
    search = [trial for trial in result.trials if trial.stage == "search"]
    more: dict[str, Any] = {}
    if result.sensitivity:
        more["model"] = _about_model(result.sensitivity)
    if study.objective.pareto:
        more["front"] = _about_front(result)
    if at_ends:
        more["at_ends"] = list(at_ends)
    accuracy = Accuracies(
        search=_accuracy(study.at_search_accuracy(study.design)),
        confirm=_accuracy(study.design).model_copy(update={"replicas": replicas}),
    )
    return StudyRecord(
        algorithm=result.algorithm,
        vary={name: list(one.ends) for name, one in study.vary.items()},
        evaluations=len(search),
        ended_early=result.ended_early,
        ended_by=result.ended_by,
        possible_gain=finite_or_none(max(result.possible_gain, 0.0)),
        counts=result.counts,
        accuracy=accuracy,
        failed=sum(trial.objective is None for trial in search),
        missing_a_constraint=_missing_a_constraint(search),
        gain=result.gain,
        improved=result.improved,
        notes=list(result.notes),
        best=BestRecord(searched_as=result.best.searched, parameters=result.best.parameters),
        start=StartRecord(
            parameters=result.start.parameters,
            objective=result.start.evaluation.objective,
            metrics=result.start.evaluation.metrics,
        ),
        confirmed=[
            ConfirmedRecord(
                searched_as=candidate.searched,
                parameters=candidate.parameters,
                objective=candidate.evaluation.objective,
                feasible=candidate.feasible,
                standing=candidate.feasibility,
                violations=[ViolationRecord(**one._asdict()) for one in candidate.violations],
            )
            for candidate in result.confirmed
        ],
        seconds=round(result.seconds, 3),
        **more,
    )


def _about_model(found: Sensitivity) -> ModelRecord:
    return ModelRecord(
        noise=found.noise,
        expected=found.expected,
        together=found.together,
        parameters={
            one.name: SliceRecord(
                flat=list(one.flat),
                share_of_variance=one.share,
                values=one.values.tolist(),
                mean=one.mean.tolist(),
                half_width=one.half_width.tolist(),
                or_worse=one.or_worse.tolist(),
                main_effect=one.effect.tolist(),
                **({"choices": list(one.texts)} if one.texts else {}),
            )
            for one in found.slices
        },
    )


def _about_front(result: StudyResult) -> list[FrontPoint]:
    """Return the confirmed points of the Pareto front, largest first objective first."""
    names = result.study.objective.goals
    points = pareto.pareto_points(result)
    front = [one for one in points if one.on_front and one.stage == "confirm"]
    return [
        FrontPoint(
            parameters=one.parameters,
            standing=one.feasibility,
            objectives=dict(zip(names, one.goals, strict=True)),
        )
        for one in sorted(front, key=lambda one: -one.goals[0].value)
    ]


def _about_sweep(sweep: SweepResult) -> SweepRecord:
    plan, study, best = sweep.plan, sweep.study, sweep.best
    return SweepRecord(
        kind="sweep",
        format=FORMAT,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        sweep=SweepFacts(
            objective=study.objective.goals[0],
            vary={name: list(one.ends) for name, one in study.vary.items()},
            method=plan.method,
            count=plan.count,
            seed=plan.seed,
            candidates=len(sweep.trials),
            failed=sum(trial.objective is None for trial in sweep.trials),
            missing_a_constraint=_missing_a_constraint(sweep.trials),
            accuracy=_accuracy(study.at_search_accuracy(study.design)),
            best=best.row() if best else None,
            seconds=round(sweep.seconds, 3),
        ),
        notes=[best_row_note(sweep)],
        files={},
        versions=versions(),
    )


def _missing_a_constraint(trials: Sequence[Trial]) -> int:
    return sum(one.objective is not None and not one.feasible for one in trials)


def _accuracy(design: Design) -> AccuracyRecord:
    return AccuracyRecord.model_validate(design.process.accuracy.model_dump(exclude_none=True))


def _design_values(design: Design, folder: Path) -> dict[str, Any]:
    """Return the values of a design as in its file, with paths relative to `folder`."""
    values: dict[str, Any] = with_paths_from(
        folder.resolve(), design.model_dump(mode="json", exclude_none=True)
    )
    return values
