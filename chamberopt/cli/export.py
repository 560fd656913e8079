"""export: what other programs read."""

from __future__ import annotations

import json as json_format
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from chamberopt.cli.console import remark, results_folder
from chamberopt.cli.options import Json, Workers, app
from chamberopt.cli.prepare import compiled
from chamberopt.common.errors import InputError
from chamberopt.output.export.formats import (
    FORMATS,
    STUDY,
    ExportFormat,
    FrameName,
    formats_by_name,
    is_file,
)

if TYPE_CHECKING:
    from chamberopt.output.results.load import Result

To = Annotated[
    list[str],
    Parameter(
        name="--to",
        negative="",
        help="What to write; may be given several times:\n\n"
        + "\n".join(f"- `{name}`: {one.summary}" for name, one in FORMATS.items()),
    ),
]


@app.command
def export(
    result: Path, /, *, to: To, frame: FrameName | None = None, replicas: int | None = None,
    workers: Workers = None, json: Json = False, out: Path | None = None,
) -> None:  # fmt: skip
    """Hand a result on to other programs. Impacts are simulated again, as no result keeps them, and compared with it.

    Parameters
    ----------
    result
        Results folder.
    frame
        Of impacts: that of the part's own file, in its unit, which is the default, or the chamber's, in mm.
    replicas
        Of impacts: only so many replicas, the first ones; they cannot be compared with the result.
    out
        Folder for the files, new or empty; or, of a single format, a file that is not there yet.
    """
    from chamberopt.output.results.load import load_result

    formats = formats_by_name(to)
    again = [name for name, one in formats.items() if one.writer is None]
    for name, given in (("frame", frame), ("replicas", replicas)):
        if given is not None and not again:
            raise InputError(
                f"--{name}: counts for impacts alone; leave it out, or add --to impacts-parquet"
            )
    loaded = None if set(formats) == {STUDY} else load_result(result)
    folder = loaded.folder if loaded else result
    impacts = 0
    with _files(formats, out, f"{folder.resolve().name}-export") as files:
        if (
            loaded and again
        ):  # first: they are refused where they do not give the result's figures again
            impacts = _impacts(
                loaded, [files[name] for name in again], frame or "part", replicas, workers
            )
        for name, one in formats.items():
            if one.writer is not None:
                remark(one.write(folder, files[name]))
    if json:
        told = {name: str(file) for name, file in files.items()}
        print(
            json_format.dumps(
                {"result": str(folder), "files": told, **({"impacts": impacts} if again else {})}
            )
        )
        return
    lines = [f"{impacts:,} impacts"] if again else []
    print("\n".join([*lines, *(f"{name:24}{file}" for name, file in files.items())]))


@contextmanager
def _files(
    formats: dict[str, ExportFormat], out: Path | None, name: str
) -> Iterator[dict[str, Path]]:
    """Where each format goes: --out where that is a file, else a new folder."""
    from chamberopt.common.files import check_new_file

    if out is not None and is_file(out, formats):
        yield {only: check_new_file(out) for only in formats}
        return
    with results_folder(out, name) as folder:
        yield {name: folder / one.file for name, one in formats.items()}


def _impacts(
    result: Result, files: list[Path], frame: FrameName, replicas: int | None, workers: int | None
) -> int:
    """Simulates the result again into these files; how many impacts there are."""
    from chamberopt.common.parallel.executor import open_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.output.export.impacts_table import require_writable, write_impacts
    from chamberopt.output.resimulate.impacts import replica_count
    from chamberopt.output.resimulate.rebuild import rebuild_chamber

    require_writable(files)
    fewer = replica_count(result, replicas) < result.data["replicas"]
    ground = rebuild_chamber(result)
    compiled(result.design, ground.chamber, ground.cavity)
    with open_executor(workers, None) as executor, progress_bar("replicas") as progress:
        impacts = write_impacts(
            files, result, ground, executor, frame=frame, replicas=replicas, progress=progress
        )
    if fewer:
        remark(
            [f"only {replicas} of {result.data['replicas']} replicas: not compared with the result"]
        )
    return impacts
