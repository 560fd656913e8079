"""What `chamberopt export` can write: one line a format. What a format needs is imported when it is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from chamberopt.common.errors import InputError

FrameName = Literal["part", "chamber"]
Write = Callable[[Path, Path], "list[str] | None"]


@dataclass(frozen=True)
class Format:
    """file: its name in a folder of exports; one without an ending is a folder · said: a line of help · write(folder
    of the result, file) -> remarks; None for impacts, which are simulated again, once for all of their formats ·
    endings that its file may have.
    """

    file: str
    said: str
    write: Write | None = None
    endings: tuple[str, ...] = ()


def _fields(to: str) -> Write:
    def write(folder: Path, file: Path) -> list[str]:
        from chamberopt.output.export.fields import write_fields

        return write_fields(folder, to, file)

    return write


def _chamber_stl(folder: Path, file: Path) -> None:
    from chamberopt.output.export.chamber_files import write_stl

    write_stl(folder, file)


def _chamber_stl_per_surface(folder: Path, file: Path) -> None:
    from chamberopt.output.export.chamber_files import write_stl_per_surface

    write_stl_per_surface(folder, file)


def _chamber_3mf(folder: Path, file: Path) -> None:
    from chamberopt.output.export.chamber_files import write_3mf

    write_3mf(folder, file)


def _study_csv(folder: Path, file: Path) -> None:
    from chamberopt.output.export.study_table import write_study_table

    write_study_table(folder, file)


STUDY = "study-csv"  # the only one that a study without a result, or a sweep, can give
FORMATS = {
    "impacts-parquet": Format(
        "impacts.parquet",
        "every impact: time, triangle, place, velocity, ball, dent",
        None,
        (".parquet",),
    ),
    "impacts-csv": Format(
        "impacts.csv", "the same as text; with --out FILE.csv.gz packed", None, (".csv", ".csv.gz")
    ),
    "fields-vtp": Format(
        "fields.vtp", "what each triangle of the part got, for ParaView", _fields("vtp"), (".vtp",)
    ),
    "fields-vtkhdf": Format("fields.vtkhdf", "the same as VTKHDF", _fields("vtkhdf"), (".vtkhdf",)),
    "fields-abaqus": Format(
        "fields.inp",
        "distributions on the elements of the part's file",
        _fields("abaqus"),
        (".inp", ".inc"),
    ),
    "fields-nastran": Format(
        "fields.bdf",
        "PLOAD4 on the elements of the part's file",
        _fields("nastran"),
        (".bdf", ".nas"),
    ),
    "chamber-stl": Format(
        "chamber.stl", "the cavity as one closed body, in mm", _chamber_stl, (".stl",)
    ),
    "chamber-stl-per-tag": Format(
        "chamber-stl",
        "an STL of each of its surfaces: part, sonotrode, wall ...",
        _chamber_stl_per_surface,
    ),
    "chamber-3mf": Format(
        "chamber.3mf", "the closed cavity, its surfaces named, in mm", _chamber_3mf, (".3mf",)
    ),
    STUDY: Format(
        "study.csv", "a study's or sweep's evaluations, finished or not", _study_csv, (".csv",)
    ),
}


def asked_formats(names: Sequence[str]) -> dict[str, Format]:
    """The formats of these names, each once. InputError for a name that is not known."""
    for name in names:
        if name not in FORMATS:
            from chamberopt.common.toml_errors import did_you_mean  # brings pydantic

            raise InputError(
                f"--to: given {name!r}; {did_you_mean(name, FORMATS)} (chamberopt export --help)"
            )
    return {name: FORMATS[name] for name in dict.fromkeys(names)}


def is_file(out: Path, formats: dict[str, Format]) -> bool:
    """Whether --out names a file, which must be that of a single format; else it is a folder."""
    ending = _ending(out, [ending for one in FORMATS.values() for ending in one.endings])
    if ending is None:
        return False
    name, single = next(iter(formats.items()))
    if len(formats) > 1:
        raise InputError(f"--out {out}: one file for {len(formats)} formats; give a folder")
    if _ending(out, single.endings) is None:
        which = (
            f"a name in {' or '.join(single.endings)}, or a folder"
            if single.endings
            else "a folder"
        )
        raise InputError(f"--out {out}: is no file of {name}; give {which}")
    return True


def _ending(path: Path, endings: Sequence[str]) -> str | None:
    return next((ending for ending in endings if path.name.lower().endswith(ending)), None)
