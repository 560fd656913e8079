"""Load and save design files. All problems of a file are reported in one error."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import write_text
from chamberopt.common.toml_fields import read_toml
from chamberopt.design.design import Design, validate
from chamberopt.design.materials import BY_NAME, NONE
from chamberopt.design.shapes.base import is_custom

__all__ = ["Design", "load_design", "read_toml", "save_design"]


def load_design(path: str | Path) -> Design:
    """Load and return the design in a file.

    Raises InputError, which names every problem with file and line.
    """
    path = Path(path)
    source, data = read_toml(path, "design")
    if is_study(data):
        raise InputError(f"{path}: this is a study file; give the design file that it names")
    return validate(Design, data, path, source)


def save_design(design: Design, path: str | Path) -> None:
    """Write a design file that loads back as the same design, with paths relative to the file."""
    import tomlkit

    path = Path(path)
    values = design.model_dump()
    for effect in BY_NAME:
        values["effects"][effect] = values["effects"][effect] or NONE
    data = with_paths_from(path.resolve().parent, _without_none(values))
    header = "# A complete candidate chamber, written by chamberopt.\n"
    header += "# Units are in the names; amplitude_um is zero-to-peak, "
    header += "amplitude_pv_um peak-to-valley.\n\n"
    write_text(path, header + tomlkit.dumps(data))


def with_paths_from(folder: Path, value: Any) -> Any:
    """Return a design's values with the paths of files among them relative to a folder."""
    if isinstance(value, Mapping):
        return {
            name: _relative(inner, folder)
            if isinstance(inner, str)
            and (name in ("mesh", "calibration") or (name == "shape" and is_custom(inner)))
            else with_paths_from(folder, inner)
            for name, inner in value.items()
        }
    is_list = isinstance(value, list | tuple)
    return [with_paths_from(folder, inner) for inner in value] if is_list else value


def _relative(path: str, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # another drive on Windows has no relative path
        return Path(path).as_posix()


def is_study(data: Mapping[str, object]) -> bool:
    """True if these values come from a study file rather than from a design file."""
    return isinstance(data.get("design"), str) or not {"vary", "optimizer"}.isdisjoint(data)


def _without_none(value: object) -> object:
    """Return a copy of the values without keys that are None or hold an empty list."""
    if isinstance(value, Mapping):
        return {k: _without_none(v) for k, v in value.items() if v is not None and v != ()}
    return [_without_none(inner) for inner in value] if isinstance(value, tuple) else value
