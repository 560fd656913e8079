"""Tell the user how to resume an interrupted study or sweep."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    from chamberopt.search.study_folder import StudyFolder


def resume_command(
    study: Path,
    folder: Path,
    plan: Mapping[str, object] | None = None,
    options: Sequence[object] = (),
) -> str:
    """Return the command line that resumes a study or sweep in `folder`, quoted for a shell.

    Args:
        plan: the method, count and seed of a sweep; None for a study.
        options: further options with which the study was begun.
    """
    if plan is None:
        return quoted("run", study, *options, "--out", folder)
    seed = () if plan["seed"] is None else ("--seed", plan["seed"])
    method = f"--{plan['method']}", plan["count"], *seed
    return quoted("sweep", study, *method, *options, "--out", folder)


def quoted(*words: object) -> str:
    """Return the command line "chamberopt WORDS", with each word quoted for a shell."""
    return shlex.join(["chamberopt", *map(str, words)])


@contextmanager
def resume_note(folder: StudyFolder, command: str) -> Iterator[None]:
    """Add `command` as a note to an error in the `with` block, if the study can be resumed.

    An InputError gets no note.
    """
    try:
        yield
    except InputError:
        raise
    except BaseException as error:
        if folder.begun:
            error.add_note(f"to resume: {command}")
        raise


def unfinished(study: Path, name: str) -> list[str]:
    """Return remarks on folders where a study was interrupted, for a command that begins it anew.

    Args:
        name: name of the folder in results/ that the command uses first.
    """
    from chamberopt.common.files import INPUTS
    from chamberopt.common.limits import MAX_RESULT_BYTES, read_limited
    from chamberopt.search.study_folder import is_finished, is_study_folder

    results, remarks = Path("results"), []
    for folder in (results / name, *sorted(results.glob(f"{name}-[0-9]*"))):
        if not is_study_folder(folder) or is_finished(folder):
            continue
        try:
            inputs = read_limited(folder / INPUTS, MAX_RESULT_BYTES, "file of a study")
            command = resume_command(study, folder, json.loads(inputs)["sweep"])
        except (InputError, ValueError, LookupError, TypeError):  # damaged; --out reports it
            command = resume_command(study, folder)
        remarks.append(f"{folder}: not finished; to resume it: {command}")
    return remarks
