"""The door: design and study files in, frozen and checked nouns out; all that is wrong in one message."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.common.toml_errors import Problem
from chamberopt.design.design import Design, checked
from chamberopt.design.shapes.base import is_own
from chamberopt.design.study import METRICS, Limits, Study

__all__ = [
    "METRICS",
    "Design",
    "Limits",
    "Study",
    "load",
    "load_design",
    "load_study",
    "save_design",
]


def load_design(path: str | Path) -> Design:
    """The design in a file. Raises InputError that names every problem, with file and line."""
    path = Path(path)
    source, data = _read(path, "design")
    if _is_study(data):
        raise InputError(
            f"{path}: this is a study file; a design file is wanted: give the one it names"
        )
    return _design(path, source, data)


def load_study(path: str | Path) -> Study:
    """The study in a file, its design loaded too. Raises InputError that names every problem and line."""
    path = Path(path)
    source, data = _read(path, "study")
    if not _is_study(data):
        raise InputError(
            f"{path}: this is a design file; a study file is wanted: one with design = ... and [vary]"
        )
    return _study(path, source, data)


def load(path: str | Path) -> Design | Study:
    """Whichever of the two the file holds: a study names a design or has [vary]."""
    path = Path(path)
    source, data = _read(path, "design or study")
    return _study(path, source, data) if _is_study(data) else _design(path, source, data)


def save_design(design: Design, path: str | Path) -> None:
    """Writes a design file that loads back as the very same design; paths of meshes and shape count from the file."""
    import tomli_w

    path = Path(path)
    data = with_paths_from(path.resolve().parent, _without_none(design.model_dump()))
    header = (
        "# A complete candidate chamber, written by chamberopt.\n"
        "# Units are in the names; amplitude_um is zero-to-peak.\n\n"
    )
    write_text(path, header + _lists_on_one_line(tomli_w.dumps(data)))


def with_paths_from(folder: Path, value: Any) -> Any:
    """The values of a design, paths of meshes and of a shape of one's own counting from a folder."""
    if isinstance(value, Mapping):
        return {
            name: _relative(inner, folder)
            if isinstance(inner, str) and (name == "mesh" or (name == "shape" and is_own(inner)))
            else with_paths_from(folder, inner)
            for name, inner in value.items()
        }
    return (
        [with_paths_from(folder, inner) for inner in value]
        if isinstance(value, list | tuple)
        else value
    )


def _relative(path: str, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive on Windows: only the absolute path leads there
        return Path(path).as_posix()


def _read(path: Path, kind: str) -> tuple[str, dict[str, Any]]:
    """Text and content of a TOML file that is there, readable, UTF-8, not empty and well formed."""
    if path.is_dir():
        inside = sorted(p.name for p in path.glob("*.toml"))
        hint = f"; files in it: {', '.join(inside[:8])}" if inside else ""
        raise InputError(f"{path}: is a folder; give a {kind} file (.toml){hint}")
    try:
        source = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(toml_errors.explain_missing_file(path, f"{kind} file", "*.toml")) from None
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}; check its permissions"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not UTF-8 text (byte {error.start}); a {kind} file is TOML, save it as UTF-8"
        ) from None
    except ValueError:  # a null character in the name
        raise InputError(f"{str(path)!r}: not a file name; check the path") from None
    if not source.strip():
        raise InputError(
            f"{path}: the file is empty; a {kind} file is TOML, start from a copy of a shipped one"
        )
    try:
        return source, tomllib.loads(source)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"^(.*?) \(at line (\d+), column (\d+)\)$", str(error), re.DOTALL)
        place, text = (
            (f"{path}:{found[2]}", f"{found[1]}, column {found[3]}") if found else (path, error)
        )
        raise InputError(
            f"{place}: not valid TOML: {text}; correct the line, e.g. name = 1.5"
        ) from None
    except (
        ValueError,
        RecursionError,
    ) as error:  # a number of thousands of digits, brackets thousands deep
        raise InputError(
            f"{path}: no {kind} file: {error}; start from a copy of a shipped one"
        ) from None


def _is_study(data: Mapping[str, Any]) -> bool:
    return isinstance(data.get("design"), str) or any(
        name in data for name in ("vary", "optimizer")
    )


def _design(path: Path, source: str, data: Mapping[str, Any]) -> Design:
    return checked(Design, data, path, source)


def _study(path: Path, source: str, data: dict[str, Any]) -> Study:
    named = data.get("design")
    if not isinstance(named, str):
        given = "missing" if named is None else f"given {named!r}"
        text = f'{given}; give the path of a design file, relative to this file: design = "../designs/gear.toml"'
        raise InputError(toml_errors.format_problems([Problem("design", text)], path, source))
    values = (
        {**data, "vary": _flattened(data["vary"])}
        if isinstance(data.get("vary"), Mapping)
        else data
    )
    try:
        design = load_design(Path(os.path.normpath(path.parent / named)))
    except InputError as error:
        said = toml_errors.format_problems(
            [Problem("design", f"given {named!r}, which cannot be used:")], path, source
        )
        raise InputError(
            "\n".join([said, str(error), *_also_wrong(values, path, source)])
        ) from None
    return checked(Study, {**values, "design": design}, path, source)


def _also_wrong(values: Mapping[str, Any], path: Path, source: str) -> list[str]:
    """What else a study file has wrong, beside a design that cannot be loaded."""
    try:
        Study.model_validate({**values, "design": None})
    except ValidationError as error:
        problems = toml_errors.explain_validation_error(error, Study)
        text = toml_errors.format_problems(
            [p for p in problems if p.field != "design"], path, source
        )
        return [text] if text else []
    return []


def _flattened(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted names, whether they were written as quoted keys, dotted keys or nested tables."""
    flat: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            flat.update(_flattened(value, f"{prefix}{name}."))
        else:
            flat[prefix + name] = value
    return flat


def _without_none(value: Any) -> Any:
    """Without what is not set, and without empty lists."""
    if isinstance(value, Mapping):
        return {
            name: _without_none(inner)
            for name, inner in value.items()
            if inner is not None and inner != ()
        }
    return [_without_none(inner) for inner in value] if isinstance(value, tuple) else value


def _lists_on_one_line(toml: str) -> str:
    """tomli_w gives every number of a list its own line; a position reads better on one."""
    lines: list[str] = []
    opened = 0
    for line in toml.splitlines():
        if opened:
            lines[-1] += line.strip() + " "
        else:
            lines.append(line)
        if opened or line.endswith("= ["):
            opened += line.count("[") - line.count("]")
    joined = (
        re.sub(r",\s*\]", "]", re.sub(r"= \[.*", lambda m: m[0].replace("[ ", "["), line)).rstrip()
        for line in lines
    )
    return "\n".join(joined) + "\n"
