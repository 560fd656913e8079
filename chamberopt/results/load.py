"""Read results folders, which simulations, studies and sweeps write."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.files import INPUTS, RESULT, open_plain, require_plain_folder
from chamberopt.common.limits import MAX_RESULT_BYTES, parse_json, read_limited
from chamberopt.common.notebook import ShownInNotebook
from chamberopt.coverage.metrics import find_metric
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.results.records import (
    FORMAT,
    CandidateRecord,
    ResultRecord,
    StudyRecord,
    read_record,
)
from chamberopt.search.trial_log import HISTORY, TIMINGS, Trial, read_trials

if TYPE_CHECKING:
    pass

START = "start"
# Folders of other commands, recognised by a file: name of the folder, and how to look at it.
OTHER_FOLDERS = {
    "calibration.json": "a calibration: see calibration.txt and calibration.png in it; designs "
    "take its machine.toml",
    "strip.json": "a virtual strip: see strip.png and strip.csv in it",
    "accuracy.json": "an accuracy study: see accuracy.png and accuracy.csv in it",
    "compare.json": "a comparison: see compare.txt in it",
    "check.json": "a check of a design: see check.json in it",
}
RESTORE = "restore the folder from where it came, or simulate again"


@dataclass(frozen=True)
class Result(ShownInNotebook):
    """A results folder that has been read.

    design: the simulated design. For a study it is the best design.
    record: the content of result.json, with the figures of `design`.
    """

    folder: Path
    design: Design
    record: CandidateRecord

    @property
    def study(self) -> StudyRecord | None:
        """The key `study` of result.json. None if the result is of a simulation."""
        return self.record.study

    @property
    def objective_name(self) -> str:
        return self.record.objective.name

    @property
    def objective(self) -> Estimate:
        return self.record.objective.estimate

    @cached_property
    def metrics(self) -> dict[str, Estimate]:
        """The result's metrics (mean coverage etc.) by name, as far as this version knows them."""
        return {name: one for name, one in self.record.metrics.items() if find_metric(name)}

    @property
    def seeds(self) -> tuple[int, str]:
        """The design's process.seed and the name of the random stream that seeds the replicas."""
        return self.record.seed, self.record.stream

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(self.record.notes)

    @property
    def gauge_mm2(self) -> float:
        """Area [mm²] of the windows, the discs of the surface in which coverage is measured."""
        return self.design.process.accuracy.gauge_mm2

    @property
    def resolves_places(self) -> bool:
        """True if enough dents were simulated to tell coverage at single points of the part."""
        field = self.record.field
        return field.dents_in_median_window >= (field.dents_needed.p05_times_intensity or 0.0)

    def path(self, name: str) -> Path:
        """Return the path of a data file of the result. Raise InputError if it was changed."""
        return unchanged_file(self.folder, name, self.record.files)


def load_result(path: str | Path) -> Result:
    """Read a results folder.

    Args:
        path: the folder or its result.json.

    Raises:
        InputError: the folder is no results folder, is unfinished or is damaged.
    """
    path = Path(path)
    if path.name != RESULT and path.is_symlink():
        try:
            path = path.resolve()  # messages then name the folder behind a link
        except (OSError, RuntimeError):  # RuntimeError before Python 3.13
            raise InputError(f"{path}: a link that leads back to itself; remove it") from None
    file = path if path.name == RESULT else path / RESULT
    folder = file.parent
    if not file.is_file():
        if any((folder / name).is_file() for name in (INPUTS, HISTORY)):
            raise InputError(
                f"{folder}: this study or sweep has not finished, {RESULT} is missing; continue it "
                "with the command that began it, such as: "
                f"chamberopt run STUDY.toml --out {shlex.quote(str(folder))}"
            )
        is_other = (text for name, text in OTHER_FOLDERS.items() if (folder / name).is_file())
        what = next(is_other, f"not a results folder, {RESULT} is missing")
        raise InputError(f"{folder}: {what}; here a folder made by simulate or run is needed")
    with _damage_explained(file):
        record = _read_record(file)
        if not isinstance(record, CandidateRecord):
            raise InputError(
                f"{folder}: a sweep is a map of many candidates, not the result of one; simulate "
                "the design that you want from it, such as its best.toml"
            )
        design = validate(Design, record.design, file, recorded=True)
        if record.seed != design.process.seed:
            raise ValueError(f"seed: given {record.seed}, its design has {design.process.seed}")
        return Result(folder, design, record)


def load_start(result: Result) -> Result | None:
    """Return the result of the design with which a study began, from the study's folder `start`.

    It is None for a result that is no study's.
    """
    if result.study is None:
        return None
    start = result.folder / START
    if not start.exists():
        raise InputError(f"{start}: not there, and a study has it; {RESTORE}")
    with _damage_explained(start):
        return load_result(require_plain_folder(start, RESTORE))


def load_trials(folder: Path) -> list[Trial]:
    """Return the trials of a study or sweep, which need not be finished.

    Raises:
        InputError: the folder has no trial log, or a file of a finished study was changed.
    """
    file = folder / RESULT
    if file.is_file():
        with _damage_explained(file):
            sha256 = _read_record(file).files
        for name in sorted({HISTORY, TIMINGS} & sha256.keys()):
            unchanged_file(folder, name, sha256)
    return read_trials(folder)


def unchanged_file(folder: Path, name: str, sha256: Mapping[str, str]) -> Path:
    """Return the path of a data file in a results folder. Raise InputError if it was changed.

    Args:
        sha256: digest of each data file by its name, from result.json.
    """
    path = folder / name
    if name not in sha256:
        raise InputError(f"{folder / RESULT}: names no {name}; {RESTORE}")
    if not path.is_file():
        raise InputError(f"{path}: not there, {RESULT} names it; {RESTORE}")
    found = file_sha256(path)
    if found != sha256[name]:
        raise InputError(
            f"{path}: not the file that was written with {RESULT}: its sha256 is {found[:16]}, "
            f"expected {sha256[name][:16]}; {RESTORE}"
        )
    return path


def file_sha256(path: Path) -> str:
    """Return the sha256 digest of a file. Raise InputError if the file cannot be read."""
    try:
        with open_plain(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}; check its permissions"
        ) from None


@contextmanager
def _damage_explained(file: Path) -> Iterator[None]:
    """Turn errors of the `with` block, which reads a result.json, into InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{file}: cannot be read: {error.strerror}; check its permissions"
        ) from None
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{file}: damaged ({type(error).__name__}: {error}); simulate again"
        ) from None


def _read_record(file: Path) -> ResultRecord:
    """Read a result.json. Raise InputError for another format or a damaged file."""
    content = read_limited(file, MAX_RESULT_BYTES, "file of a result")
    data = parse_json(content)
    if not isinstance(data, dict):
        raise ValueError("it holds no table")
    if data["format"] != FORMAT:
        raise _of_another_format(file, data)
    if data.get("sha256") != content_sha256(data):
        raise InputError(f"{file}: not as it was written: its sha256 is another; {RESTORE}")
    return read_record(data)


def _of_another_format(file: Path, data: dict[str, object]) -> InputError:
    found, versions = data["format"], data.get("versions")
    versions = versions if isinstance(versions, dict) else {}
    made_by = versions.get("chamberopt", "an unknown version")
    newer = isinstance(found, int) and found > FORMAT
    remedy = "read it with that version" if newer else "simulate again, or read it with that one"
    return InputError(
        f"{file}: in format {found!r}, expected {FORMAT}: written by chamberopt {made_by}, another "
        f"version than this; {remedy}"
    )


def content_sha256(data: Mapping[str, object]) -> str:
    """Return the sha256 digest of the content of a result.json, without its key sha256.

    The order of the keys does not matter.
    """
    rest = {name: value for name, value in data.items() if name != "sha256"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()
