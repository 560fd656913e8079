"""What a sweep leaves on disk: its rows as a table, the best design, and the map as a picture."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.files import write_text
from chamberopt.common.versions import versions
from chamberopt.design.load import save_design
from chamberopt.optimize.storage.study_folder import RESULT
from chamberopt.optimize.storage.trial_log import read_trials, trials_as_csv
from chamberopt.output.plots.sweep import sweep_map
from chamberopt.output.results.load import FORMAT

if TYPE_CHECKING:
    from chamberopt.optimize.run_sweep import SweepResult


def write_sweep(folder: str | Path, sweep: SweepResult) -> list[str]:
    """Complete the folder of a sweep that has ended; returns remarks, such as a picture that leaves pairs out.

    Beside design.toml, study.toml and history.jsonl, which run_sweep wrote: history.csv · result.json · map.png ·
    best.toml, unless no candidate is feasible.
    """
    folder = Path(folder)
    write_text(folder / "history.csv", trials_as_csv(read_trials(folder)))
    if sweep.best is not None:
        save_design(sweep.study.design.changed(sweep.best.parameters), folder / "best.toml")
    remarks = sweep_map(folder / "map.png", sweep)
    write_text(
        folder / RESULT, json.dumps(_about(sweep), indent=2, allow_nan=False) + "\n"
    )  # last: it is finished
    return remarks


def caution(sweep: SweepResult) -> str:
    """What to know of the best row of a sweep."""
    if sweep.best is None:
        return (
            "no candidate meets the constraints: loosen them or widen [vary]; there is no best.toml"
        )
    return (
        f"the best of {len(sweep.trials)} candidates is also the luckiest of them: its figures promise too much; for "
        "ones that do not, simulate best.toml with another process.seed, or search with chamberopt run"
    )


def _about(sweep: SweepResult) -> dict[str, Any]:
    plan, study, best = sweep.plan, sweep.study, sweep.best
    return {
        "kind": "sweep",
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "sweep": {
            "objective": study.objective.goals[0],
            "vary": {name: list(bounds) for name, bounds in study.vary.items()},
            "method": plan.method,
            "count": plan.count,
            "seed": plan.seed,
            "candidates": len(sweep.trials),
            "failed": sum(trial.objective is None for trial in sweep.trials),
            "missing_a_constraint": sum(
                t.objective is not None and not t.feasible for t in sweep.trials
            ),
            "accuracy": study.at_search_accuracy(study.design).process.accuracy.model_dump(
                exclude_none=True
            ),
            "best": best.row() if best else None,
            "seconds": round(sweep.seconds, 3),
        },
        "notes": [caution(sweep)],
        "versions": versions(),
    }
