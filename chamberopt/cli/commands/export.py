"""The command `export`: write results in the formats of other programs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from chamberopt.cli.console import print_json, print_remarks, results_folder, show
from chamberopt.cli.options import Json, Workers, app
from chamberopt.cli.prepare import compile_with_message
from chamberopt.common.errors import InputError
from chamberopt.export import formats as export_formats
from chamberopt.export.formats import FORMATS, ExportFormat, FrameName

if TYPE_CHECKING:
    from chamberopt.results.load import Result

To = Annotated[
    list[str] | None,
    Parameter(
        name="--to",
        negative="",
        help="What to write; may be given several times:\n\n"
        + "\n".join(f"- `{name}`: {one.summary}" for name, one in FORMATS.items()),
    ),
]


@app.command
def export(
    result: Path,
    /,
    *,
    to: To = None,
    mesh: Path | None = None,
    frame: FrameName | None = None,
    replicas: int | None = None,
    workers: Workers = None,
    json: Json = False,
    out: Path | None = None,
) -> None:
    """Write a result in the formats of other programs.

    A result does not store its impacts. To export them, it is simulated again, and the new
    simulation must be the same as the old one to the last bit.

    Parameters
    ----------
    result
        Results folder.
    mesh
        Your own deck of the part for stress-solid: Abaqus or CalculiX, with elements C3D4 or C3D10.
    frame
        Coordinates of impacts: "part" (default), as in the part's file and in its unit; or
        "chamber", in mm.
    replicas
        Export the impacts of this many replicas only; they are not compared with the result.
    out
        Folder for the files, new or empty; for a single format also a file that does not exist.
    """
    from chamberopt.common.progress import step
    from chamberopt.results.load import load_result

    formats = export_formats.formats_by_name(to or ())
    from_impacts = [name for name, one in formats.items() if one.writer is None]
    for name, given in (("frame", frame), ("replicas", replicas)):
        if given is not None and not from_impacts:
            text = "applies only to impact exports; remove it or add --to impacts-parquet"
            raise InputError(f"--{name}: {text}")
    take_mesh = [name for name, one in formats.items() if one.takes_mesh]
    if mesh is None and take_mesh:
        raise InputError(f"--to {take_mesh[0]}: takes --mesh DECK, your own deck of the part")
    if mesh is not None and not take_mesh:
        raise InputError("--mesh: applies only to stress-solid; remove it or add --to stress-solid")
    loaded = None if set(formats) == {export_formats.STUDY} else load_result(result)
    folder = loaded.folder if loaded else result
    counts: dict[str, int] = {}
    with _files(formats, out, f"{folder.resolve().name}-export") as files:
        remarks: list[str] = []
        for name, one in formats.items():
            if one.writer is not None:
                with step(name):
                    remarks += one.write(folder, files[name], mesh)
        print_remarks(dict.fromkeys(remarks))  # several formats may have the same remark
        # Impacts come last, because simulating them takes long. Other errors are reported before.
        if loaded and from_impacts:
            tables = [files[name] for name in from_impacts]
            counts["impacts"] = _write_impacts(loaded, tables, frame or "part", replicas, workers)
    if json:
        paths = {name: str(file) for name, file in files.items()}
        print_json({"result": str(folder), "files": paths, **counts})
        return
    lines = [f"{count:,} {what}" for what, count in counts.items()]
    show([*lines, *(f"{name:24}{file}" for name, file in files.items())])


@contextmanager
def _files(
    formats: dict[str, ExportFormat], out: Path | None, name: str
) -> Iterator[dict[str, Path]]:
    """Yield the path of the file to write, by the name of each format.

    The path is `out` (option --out) if `out` names a file, else a file in a new folder.
    """
    from chamberopt.common.files import check_new_file, claim_file, whole_or_nothing

    if out is not None and export_formats.is_file(out, formats):
        (only,) = formats
        with claim_file(check_new_file(out)) as file:
            yield {only: file}
        return
    with results_folder(out, name) as folder, whole_or_nothing(folder):
        yield {name: folder / one.file for name, one in formats.items()}


def _write_impacts(
    result: Result, files: list[Path], frame: FrameName, replicas: int | None, workers: int | None
) -> int:
    """Simulate the result again, write its impacts to the files, and return their number."""
    from chamberopt.common.executor import open_executor
    from chamberopt.common.progress import step
    from chamberopt.coverage.part_impacts import HITS_FILE
    from chamberopt.export.impacts_table import require_writable, write_impacts
    from chamberopt.results.impacts import replica_count
    from chamberopt.results.rebuild import rebuild_chamber

    require_writable(files)
    recorded = result.record.replicas
    count = replica_count(result, replicas)
    result.path(HITS_FILE)  # the impacts are compared with this file at the end
    ground = rebuild_chamber(result)
    with open_executor(workers, None) as executor:
        compile_with_message(result.design, ground.chamber, ground.cavity)
        with step("impacts, replicas", count) as progress:
            impacts = write_impacts(
                files, result, ground, executor, frame=frame, replicas=replicas, progress=progress
            )
    if count < recorded:
        print_remarks([f"only {replicas} of {recorded} replicas: not compared with the result"])
    return impacts
