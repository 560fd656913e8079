"""Write a further study of the same question, which begins with the best candidate of another."""

from __future__ import annotations

from itertools import count
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, write_text
from chamberopt.common.toml_fields import read_toml
from chamberopt.search.trial_log import read_trials


def write_further_study(before: Path, folder: Path, evaluations: int) -> Path:
    """Write a study file beside another, and return its path.

    It asks what the other study asks, but begins with the best candidate so far, and has a seed of
    its own, so that its evenly spread candidates are not those of before.

    Args:
        before: the file of the other study.
        folder: results folder of the other study.
        evaluations: budget of the further study.

    Raises InputError if no candidate of the other study meets its constraints.
    """
    import tomlkit

    trials = [one for one in read_trials(folder) if one.stage == "search" and one.feasible]
    if not trials:
        raise InputError(f"{folder.name}: no candidate meets the constraints yet; resume it first")
    values = tomlkit.inline_table()
    values.update(max(trials, key=lambda one: one.score).parameters)
    document = tomlkit.parse(read_toml(before, "study")[0])
    best = tomlkit.array()
    best.append(values)
    document["begin_with"] = best
    if "optimizer" not in document:
        document["optimizer"] = tomlkit.table()
    settings = document["optimizer"]
    settings["evaluations"], settings["seed"] = evaluations, int(settings.get("seed", 1)) + 1
    path = check_new_file(_free_name(before))
    write_text(path, tomlkit.dumps(document))
    return path


def _free_name(before: Path) -> Path:
    """Return NAME-2.toml for NAME.toml, or NAME-3.toml and so on where a file has this name."""
    stem, _, number = before.stem.rpartition("-")
    stem, first = (stem, int(number) + 1) if stem and number.isdecimal() else (before.stem, 2)
    tried = (before.with_name(f"{stem}-{k}.toml") for k in count(first))
    return next(path for path in tried if not path.exists())
