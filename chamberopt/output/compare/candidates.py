"""What `compare` was given, designs and results mixed; and the simulating of what is missing, on common seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.common.progress import progress_bar
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.output.compare.comparison import part_unit
from chamberopt.output.compare.inputs import (
    require_one_time,
    require_same_part,
    require_same_triangles,
    require_several,
)
from chamberopt.output.compare.parameters import labels
from chamberopt.output.results.load import Result, load_result
from chamberopt.output.save_run import save_simulation
from chamberopt.output.vtp_files import COVERAGE, read_surface
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.simulation.effect_pilot import Advice
    from sim_core import AnalyticCavity

Prepare = Callable[[Design, "Chamber", "AnalyticCavity | None"], "tuple[Design, list[Advice]]"]
"""Chooses the effects of a design that leaves them open, and compiles."""


@dataclass(frozen=True)
class Candidate:
    """One argument of `compare`.

    path: as given · design: what is to be compared · result: as it was read, None of a design · missing: whether it is
    to be simulated · chamber: built where it is.
    """

    label: str
    path: Path
    design: Design
    result: Result | None
    missing: bool
    chamber: Chamber | None = None


@dataclass(frozen=True)
class Draws:
    """On what a candidate is simulated: seed and stream, replicas (None: as its accuracy asks), for what objective."""

    seed: int
    stream: str
    replicas: int | None
    objective_name: str


def gathered(paths: Sequence[str | Path], treatment_time_s: float | None = None) -> list[Candidate]:
    """The candidates that paths name: designs where they are files, else results; nothing is simulated yet.

    treatment_time_s: all are to be peened so long; results of another time will be simulated again. Raises InputError
    for what cannot be read, built or compared.
    """
    places = [Path(path) for path in paths]
    require_several([place.parent if place.name == "result.json" else place for place in places])
    found = [_read(place) for place in places]
    if treatment_time_s is not None:
        found = [_peened_for(one, treatment_time_s) for one in found]
    designs = [one.design for one in found]
    require_one_time(places, designs)
    target: np.ndarray | None = None
    built = []
    for one, label in zip(found, labels([_named(place) for place in places]), strict=True):
        own, chamber = None, None
        if one.design.part.target.reachable:
            own = target if one.result is None else _target(one.result)
        if one.missing:
            chamber = build_chamber(one.design, own)
            own = chamber.part.target if one.design.part.target.reachable else None
        if own is not None:
            target = own if target is None else target
            require_same_triangles(one.path, own, places[0], target)
        built.append(replace(one, label=label, chamber=chamber))
    require_same_part(places, designs, [_mesh(one) for one in built])
    return built


def simulated(
    candidates: Sequence[Candidate], folder: Path, executor: Executor, prepare: Prepare
) -> tuple[list[Result], list[str]]:
    """The result of each; what is missing is simulated into folders inside `folder`. With remarks.

    Designs get seed, stream and number of replicas of the first candidate; results of another treatment time their own.
    """
    results: list[Result] = []
    remarks: list[str] = []
    names = _folder_names(candidates)
    for one, name in zip(candidates, names, strict=True):
        if one.result is not None and not one.missing:
            results.append(one.result)
            continue
        if one.result is not None:
            draws = _draws(one.result)
            seconds = one.design.process.treatment_time_s
            remarks.append(f"{one.label}: simulated again for {seconds:g} s, on its own seeds")
        else:
            draws = (
                _draws(results[0])
                if results
                else Draws(one.design.process.seed, "search", None, "uniform_coverage")
            )
            remarks += _overridden(one, draws)
        new, said = _simulate(one, draws, folder / name, executor, prepare)
        results.append(new)
        remarks += said
    return results, remarks


def _simulate(
    one: Candidate, draws: Draws, folder: Path, executor: Executor, prepare: Prepare
) -> tuple[Result, list[str]]:
    assert one.chamber is not None
    asked = _drawn(one.design, draws)
    cavity = (
        analytic_cavity(asked, one.chamber)
        if one.result and one.result.data.get("analytic")
        else None
    )
    design, advice = prepare(asked, one.chamber, cavity)
    with progress_bar(f"{one.label}: replicas") as progress:
        plan = ReplicaPlan(draws.replicas, draws.stream, draws.objective_name)
        evaluation = evaluate(design, one.chamber, executor, progress, plan, cavity)
    remarks = save_simulation(folder, design, one.chamber, evaluation, advice)
    return load_result(folder), [f"{one.label}: {text}" for text in (*map(str, advice), *remarks)]


def _drawn(design: Design, draws: Draws) -> Design:
    """The design with these draws in place of its own: its file then says what was done."""
    values: dict[str, Any] = {"process.seed": draws.seed}
    if draws.replicas is not None:
        values["process.accuracy.replicas"] = draws.replicas
        values["process.accuracy.objective_half_width"] = None
    return design.changed(values)


def _overridden(one: Candidate, draws: Draws) -> list[str]:
    """What a design asks for and does not get."""
    process = one.design.process
    said = []
    if process.seed != draws.seed:
        said.append(f"seed = {draws.seed} in place of {process.seed}")
    if draws.replicas is not None and process.accuracy.objective_half_width is not None:
        said.append(
            f"{draws.replicas} replicas in place of as many as make ± {process.accuracy.objective_half_width:g}"
        )
    elif draws.replicas not in (None, process.accuracy.replicas):
        said.append(f"{draws.replicas} replicas in place of {process.accuracy.replicas}")
    return [f"{one.label}: {' and '.join(said)}, as the first candidate"] if said else []


def _read(place: Path) -> Candidate:
    if place.suffix == ".toml" or (place.is_file() and place.name != "result.json"):
        return Candidate("", place, load_design(place), None, missing=True)
    result = load_result(place)
    return Candidate("", place, result.design, result, missing=False)


def _peened_for(one: Candidate, seconds: float) -> Candidate:
    if one.design.process.treatment_time_s == seconds:
        return one
    return replace(
        one, design=one.design.changed({"process.treatment_time_s": seconds}), missing=True
    )


def _named(place: Path) -> Path:
    """A design by its name without .toml, a result by its folder."""
    return (
        place.with_suffix("")
        if place.suffix == ".toml"
        else place.parent
        if place.name == "result.json"
        else place
    )


def _mesh(one: Candidate) -> tuple[str, str]:
    if one.chamber is not None:
        return one.chamber.part.sha256, one.chamber.part.unit
    assert one.result is not None
    return one.result.part_sha256, part_unit(one.result)


def _target(result: Result) -> np.ndarray:
    return np.asarray(read_surface(result.folder / COVERAGE)["target"]) > 0


def _draws(result: Result) -> Draws:
    seed, stream = result.seeds
    return Draws(seed, stream, int(result.data["replicas"]), result.objective_name)


def _folder_names(candidates: Sequence[Candidate]) -> list[str]:
    """The last name of each, told apart by a number where two are the same."""
    names: list[str] = []
    for one in candidates:
        name, number = _named(one.path).resolve().name, 1
        while (numbered := name if number == 1 else f"{name}-{number}") in names:
            number += 1
        names.append(numbered)
    return names
