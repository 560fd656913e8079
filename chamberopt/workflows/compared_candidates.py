"""Read the candidates of the command `compare`, and simulate the candidates without a result."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.build import build_chamber
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.results.arrays_file import load_chamber
from chamberopt.results.compare.comparison import (
    labels,
    part_unit,
    require_same_gauge,
    require_same_machine,
    require_same_part,
    require_same_time,
    require_same_triangles,
    require_several,
)
from chamberopt.results.load import Result, load_result
from chamberopt.simulation.evaluate import ReplicaPlan
from chamberopt.workflows.simulate import SimulationSettings, Teller, simulate_design

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber


@dataclass(frozen=True)
class Candidate:
    """A design or a result that the command `compare` was given.

    Args:
        label: short name, unique among the candidates.
        path: path as given.
        design: the design to compare.
        result: the result in the folder; None for a design.
        missing: True if the design has to be simulated.
        chamber: the chamber of a design that has to be simulated.
    """

    label: str
    path: Path
    design: Design
    result: Result | None
    missing: bool
    chamber: Chamber | None = None


def read_candidates(
    paths: Sequence[str | Path], treatment_time_s: float | None = None
) -> list[Candidate]:
    """Return the candidates that `compare` was given, without simulating them.

    Args:
        paths: design files and results folders.
        treatment_time_s: peening time of all candidates. A result with another time is marked as
            `missing`, so that it is simulated again.

    Raises:
        InputError: a candidate cannot be read, built or compared with the first.
    """
    files = [Path(path) for path in paths]
    require_several([file.parent if file.name == "result.json" else file for file in files])
    found = [_read(file) for file in files]
    if treatment_time_s is not None:
        found = [_with_treatment_time(one, treatment_time_s) for one in found]
    designs = [one.design for one in found]
    require_same_time(files, designs)
    require_same_gauge(files, designs)
    require_same_machine(files, designs)
    target: np.ndarray | None = None
    built = []
    for one, label in zip(found, labels([_named(file) for file in files]), strict=True):
        own, chamber = None, None
        if one.design.part.target.reachable:
            own = target if one.result is None else _target(one.result)
        if one.missing:
            if one.result:
                one.design.require_one_step("simulating a result again for another time")
            chamber = load_chamber(one.result) if one.result else build_chamber(one.design, own)
            own = chamber.part.target if one.design.part.target.reachable else None
        if own is not None:
            target = own if target is None else target
            require_same_triangles(one.path, own, files[0], target)
        built.append(replace(one, label=label, chamber=chamber))
    require_same_part(files, designs, [_mesh(one) for one in built])
    return built


def simulate_missing(
    candidates: Sequence[Candidate], folder: Path, executor: Executor, teller: Teller
) -> tuple[list[Result], list[str]]:
    """Simulate the candidates that have no result yet.

    Return the result of each candidate, and remarks for the user.

    Designs are simulated with seed, random stream and number of replicas of the first candidate. A
    result that is simulated again for another treatment time keeps its own seed and replicas. New
    results are written to folders inside `folder`.
    """
    results: list[Result] = []
    remarks: list[str] = []
    names = _folder_names(candidates)
    for one, name in zip(candidates, names, strict=True):
        if one.result is not None and not one.missing:
            results.append(one.result)
            continue
        like = one.result or (results[0] if results else None)
        if one.result is not None:
            seconds = one.design.process.treatment_time_s
            remarks.append(f"{one.label}: simulated again for {seconds:g} s, on its own seeds")
        elif like is not None:
            remarks += _overridden(one, like)
        new, more = _simulate(one, like, folder / name, executor, teller)
        results.append(new)
        remarks += more
    return results, remarks


def _simulate(
    one: Candidate, like: Result | None, folder: Path, executor: Executor, teller: Teller
) -> tuple[Result, list[str]]:
    """Simulate a candidate, with the seeds and the number of replicas of the result `like`."""
    assert one.chamber is not None
    design, plan = one.design, ReplicaPlan()
    if like is not None:
        record = like.record
        plan = ReplicaPlan(record.replicas, record.stream, like.objective_name)
        design = design.changed(
            {
                "process.seed": record.seed,
                "process.accuracy.replicas": record.replicas,
                "process.accuracy.objective_half_width": None,
            }
        )
    teller.check(design, one.chamber)
    analytic = one.result is not None and one.result.record.analytic
    settings = SimulationSettings(analytic, plan=plan, step=f"{one.label}: replicas")
    done = simulate_design(design, folder, executor, teller, settings, one.chamber)
    said = *map(str, done.advice), *done.remarks
    return load_result(folder), [f"{one.label}: {text}" for text in said]


def _overridden(one: Candidate, first: Result) -> list[str]:
    """Return remarks on values of a design that are replaced by the first candidate's."""
    process, accuracy = one.design.process, one.design.process.accuracy
    seed, replicas = first.record.seed, first.record.replicas
    changes = []
    if process.seed != seed:
        changes.append(f"seed = {seed} instead of {process.seed}")
    if accuracy.objective_half_width is not None:
        asked = f"as many as give ± {accuracy.objective_half_width:g}"
        changes.append(f"{replicas} replicas instead of {asked}")
    elif replicas != accuracy.replicas:
        changes.append(f"{replicas} replicas instead of {accuracy.replicas}")
    return [f"{one.label}: {' and '.join(changes)}, as the first candidate"] if changes else []


def _read(path: Path) -> Candidate:
    if path.suffix == ".toml" or (path.is_file() and path.name != "result.json"):
        return Candidate("", path, load_design(path), None, missing=True)
    result = load_result(path)
    return Candidate("", path, result.design, result, missing=False)


def _with_treatment_time(one: Candidate, seconds: float) -> Candidate:
    if one.design.process.treatment_time_s == seconds:
        return one
    return replace(
        one, design=one.design.changed({"process.treatment_time_s": seconds}), missing=True
    )


def _named(path: Path) -> Path:
    """Return the path from which a candidate's label is made.

    It is a design's path without .toml, or the folder of a result.
    """
    if path.suffix == ".toml":
        return path.with_suffix("")
    return path.parent if path.name == "result.json" else path


def _mesh(one: Candidate) -> tuple[str, str]:
    if one.chamber is not None:
        return one.chamber.part.sha256, one.chamber.part.unit
    assert one.result is not None
    return one.result.record.part_sha256, part_unit(one.result)


def _target(result: Result) -> np.ndarray:
    return load_chamber(result).part.target


def _folder_names(candidates: Sequence[Candidate]) -> list[str]:
    """Return a folder name for each candidate: the last name of its path.

    A number is added if another candidate has the same name.
    """
    names: list[str] = []
    for one in candidates:
        name, number = _named(one.path).resolve().name, 1
        while (numbered := name if number == 1 else f"{name}-{number}") in names:
            number += 1
        names.append(numbered)
    return names
