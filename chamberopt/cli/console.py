"""Print results of commands on stdout and remarks on stderr. Reserve folders for results."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import asdict, is_dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, TypeVar

from chamberopt.common.errors import visible

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.documents.document import Table

T = TypeVar("T")
RESULTS = Path("results")  # parent folder of results without --out


def results_folder(out: Path | None, name: str) -> AbstractContextManager[Path]:
    """Reserve the folder that the option --out gives, which must be new or empty, for a result.

    Without --out, reserve the first free folder of results/NAME, results/NAME-2 and so on.
    """
    from chamberopt.common.files import claim_folder

    return claimed_folder(out, name, claim_folder)


@contextmanager
def claimed_folder(
    out: Path | None, name: str, claim: Callable[[Path], AbstractContextManager[T]]
) -> Iterator[T]:
    """Reserve a folder for a result and yield what `claim` returns for it.

    Args:
        out: folder that the option --out gives. None for the first free folder of results/NAME,
            results/NAME-2 and so on.
        claim: function that reserves a folder. It decides which folders `out` may be.
    """
    from chamberopt.common.errors import OutputTakenError
    from chamberopt.common.files import is_new_or_empty, require_plain_folder

    with ExitStack() as held:
        if out is not None:
            yield held.enter_context(claim(out))
            return
        if os.path.lexists(RESULTS):
            require_plain_folder(RESULTS, "give another folder (--out)")
        for number in count(1):
            folder = RESULTS / (name if number == 1 else f"{name}-{number}")
            if is_new_or_empty(folder):
                try:
                    claimed = held.enter_context(claim(folder))
                except OutputTakenError:  # another command was faster
                    continue
                yield claimed
                return


def show(content: Iterable[Table | str], to: TextIO | None = None) -> None:
    """Print tables and sentences to stdout, or to `to`, with control characters made visible.

    Names of files, keys and groups may hold control characters, which a terminal would obey.
    """
    from chamberopt.printers import terminal

    print(visible(terminal.text(content)), file=to or sys.stdout, flush=True)


def print_remarks(remarks: Iterable[str]) -> None:
    """Print remarks, such as a skipped picture, to stderr: with --json, stdout holds only JSON."""
    for remark in remarks:
        show([remark], sys.stderr)


def print_warnings(design: Design, chamber: Chamber, which: str = "") -> list[str]:
    """Print the warnings of `check` to stderr, and return them for result.json.

    `which` names the design if there are several, e.g. " of the best design".
    """
    from chamberopt.chamber.checks.check import warnings

    found = [one.text for one in warnings(design, chamber)]
    print_remarks([f"warning{which}: {text}" for text in found])
    return found


def print_json(values: Mapping[str, object]) -> None:
    print(json.dumps(values, indent=2, default=_json_value))


def _json_value(value: object) -> object:
    """Return an estimate, record or dataclass as JSON values. Raise TypeError for other types."""
    from chamberopt.common.estimate import Estimate
    from chamberopt.common.record_types import Table

    if isinstance(value, Estimate):
        return value.interval_json()
    if isinstance(value, Table):
        return value.as_json()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    raise TypeError(f"{type(value).__name__} is no JSON value")


def print_result(
    content: Sequence[Table | str], folder: Path, as_json: bool, file: str = "result.json"
) -> None:
    """Print a result and its folder on stdout, as text or as the content of a JSON file."""
    if as_json:
        from chamberopt.common.limits import MAX_RESULT_BYTES, read_limited

        values = json.loads(read_limited(folder / file, MAX_RESULT_BYTES, "file of a result"))
        print_json({**values, "folder": str(folder)})
    else:
        show([*content, f"results in {folder}"])


def print_finished(folder: Path, what: str, content: Sequence[Table | str], as_json: bool) -> None:
    """Print the stored result of a study or sweep that had finished before this command."""
    again = "to run it again, give another folder (--out)"
    print_remarks([f"{folder}: this {what} is finished, nothing was run; {again}"])
    print_result(content, folder, as_json)
