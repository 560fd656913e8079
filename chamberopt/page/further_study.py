"""Write a further study of the same question, which begins with the best candidate of another."""

from __future__ import annotations

from itertools import count
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, write_text
from chamberopt.common.toml_fields import read_toml
from chamberopt.results.load import load_result
from chamberopt.search.study_folder import is_finished
from chamberopt.search.trial_log import read_trials

NOTHING_LEFT = {  # by the reasons in search/optimiser/point_search.py
    "gain": "nothing is left to gain that counts between these values",
    "values": "all values that it may choose from were simulated",
}


def write_further_study(before: Path, folder: Path, evaluations: int) -> Path:
    """Write a study file beside another, and return its path.

    It asks what the other study asks, but begins with the best candidate so far, and has a seed of
    its own, so that its evenly spread candidates are not those of before. The budget holds the
    start and the best candidate beside the new ones.

    Args:
        before: the file of the other study.
        folder: results folder of the other study.
        evaluations: number of new candidates of the further study. It tries more where some of
            them are refused by geometry, or told by few replicas.

    Raises InputError if no candidate of the other study meets its constraints, if the other study
    ended because there is nothing left to try, or if there would be no new candidate.
    """
    import tomlkit

    trials = [one for one in read_trials(folder) if one.stage == "search" and one.feasible]
    if not trials:
        raise InputError(f"{folder.name}: no candidate meets the constraints yet; resume it first")
    if is_finished(folder) and (reason := NOTHING_LEFT.get(_ended_by(folder))):
        remedy = "search between wider values, or for another aim"
        raise InputError(f"{folder.name}: {reason}; {remedy}")
    if evaluations < 1:
        raise InputError(f"new chambers to simulate: given {evaluations}; give 1 or more")
    values = tomlkit.inline_table()
    first = max(trials, key=lambda one: one.score)
    values.update(first.parameters)
    document = tomlkit.parse(read_toml(before, "study")[0])
    best = tomlkit.array()
    best.append(values)
    document["begin_with"] = best
    if "optimizer" not in document:
        document["optimizer"] = tomlkit.table()
    settings = document["optimizer"]
    known = 1 if first.number == 0 else 2  # the start, and the best where it is another
    settings["evaluations"] = evaluations + known
    settings["seed"] = int(settings.get("seed", 1)) + 1
    path = check_new_file(_free_name(before))
    write_text(path, tomlkit.dumps(document))
    return path


def _ended_by(folder: Path) -> str:
    """Return why the search of a finished study ended; "" if this is not known."""
    study = load_result(folder).record.study
    return (study.ended_by if study else None) or ""


def _free_name(before: Path) -> Path:
    """Return NAME-2.toml for NAME.toml, or NAME-3.toml and so on where a file has this name."""
    stem, _, number = before.stem.rpartition("-")
    stem, first = (stem, int(number) + 1) if stem and number.isdecimal() else (before.stem, 2)
    tried = (before.with_name(f"{stem}-{k}.toml") for k in count(first))
    return next(path for path in tried if not path.exists())
