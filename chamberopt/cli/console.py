"""What the commands say, and where they leave it: results to stdout, remarks to stderr."""

from __future__ import annotations

import json as json_format
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.statistics.confidence_interval import Estimate
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation


@contextmanager
def results_folder(out: Path | None, name: str) -> Iterator[Path]:
    """Where results go: --out (new or empty), else the first free of results/NAME, results/NAME-2 ...

    When nothing came of it the folder does not stay behind empty.
    """
    from chamberopt.common.files import make_output_folder

    folder = make_output_folder(out) if out is not None else _claimed(name)
    try:
        yield folder
    except BaseException:
        with suppress(OSError):
            if not any(folder.iterdir()):
                folder.rmdir()
        raise


def _claimed(name: str) -> Path:
    """The first free folder results/NAME, results/NAME-2 ...: whoever makes it has it, if two look at once."""
    from chamberopt.common.files import is_new_or_empty, make_output_folder

    for number in count(1):
        folder = Path("results", name if number == 1 else f"{name}-{number}")
        if not is_new_or_empty(folder):
            continue
        try:
            if not folder.is_dir():
                folder.parent.mkdir(parents=True, exist_ok=True)
                folder.mkdir()
        except FileExistsError:
            if folder.exists():  # another command was faster
                continue
        except OSError:
            pass  # make_output_folder says what is wrong
        return make_output_folder(folder)
    raise AssertionError("there is always a next number")


def remark(remarks: Sequence[str]) -> None:
    """What went less than well, such as a picture skipped: to stderr, so that --json stays clean."""
    for remark in remarks:
        print(remark, file=sys.stderr)


def warn(design: Design, chamber: Chamber, which: str = "") -> list[str]:
    """What `check` would warn of, to stderr, and for result.json; which: the design, where it is one of several."""
    from chamberopt.chamber.checks.check import warnings

    found = warnings(design, chamber)
    remark([f"warning{which}: {text}" for text in found])
    return found


def estimates(evaluation: Evaluation) -> list[str]:
    """Objective and metrics, a line each, with their 95 % intervals."""
    rows = {evaluation.objective_name: evaluation.objective, **evaluation.metrics}
    return [row(name, estimate) for name, estimate in rows.items()]


def row(name: str, estimate: Estimate) -> str:
    from chamberopt.coverage.statistics.confidence_interval import ZERO_TOLERANCE

    value, half_width = (
        0.0 if abs(x) < ZERO_TOLERANCE else x for x in (estimate.value, estimate.half_width)
    )
    return f"{name:34}{value:12.5g} ± {half_width:.2g}"


def accuracy_said(design: Design) -> str:
    """How accurate a search is, in words."""
    accuracy = design.process.accuracy
    if accuracy.objective_half_width is not None:
        return f"as many as make ± {accuracy.objective_half_width:g}"
    return f"{accuracy.replicas} replicas of {design.process.recorded_time:g} s"


def notes_said(notes: Sequence[str]) -> list[str]:
    return [f"note: {note}" for note in notes]


def facts_said(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    """A nested table as aligned lines; lists of sentences as notes and warnings."""
    lines: list[str] = []
    for name, value in table.items():
        if isinstance(value, Mapping) and set(value) == {"low", "start", "high"}:
            lines.append(
                f"{prefix + name:33} {value['start']:g} in {value['low']:g} .. {value['high']:g}"
            )
        elif isinstance(value, Mapping):
            lines += facts_said(value, f"{prefix}{name}.")
        elif name in ("notes", "warnings"):
            lines += [f"{name.removesuffix('s')}: {text}" for text in value]
        else:
            text = _listed(value, name) if isinstance(value, list) else str(value)
            lines.append(f"{prefix + name:34}{text}")
    return lines


def _listed(values: list[Any], name: str) -> str:
    """Sizes as 1 x 2 x 3, other numbers and names with commas."""
    if values and isinstance(values[0], float):
        return (" x " if name.startswith("bounding_box") else ", ").join(
            f"{value:g}" for value in values
        )
    return ", ".join(values) or "none"


def say(lines: Sequence[str], folder: Path, json: bool) -> None:
    """The outcome on stdout: text, or what result.json holds; either way with the folder."""
    if json:
        result = json_format.loads((folder / "result.json").read_text(encoding="utf-8"))
        print(json_format.dumps({**result, "folder": str(folder)}, indent=2))
    else:
        print("\n".join([*lines, f"results in {folder}"]))
