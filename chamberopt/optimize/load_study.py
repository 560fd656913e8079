"""Load study files; every problem of a file, or of the design it names, is reported in one error."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import Problem
from chamberopt.design.design import Design, validate
from chamberopt.design.load import is_study, load_design, read_toml
from chamberopt.optimize.study import Study


def load_study(path: str | Path) -> Study:
    """The study in a file, its design loaded too. Raises InputError that names every problem and line."""
    path = Path(path)
    source, data = read_toml(path, "study")
    if not is_study(data):
        raise InputError(
            f"{path}: this is a design file; a study file is wanted: one with design = ... and [vary]"
        )
    return _study(path, source, data)


def load(path: str | Path) -> Design | Study:
    """Whichever of the two the file holds: a study names a design or has [vary]."""
    path = Path(path)
    source, data = read_toml(path, "design or study")
    return _study(path, source, data) if is_study(data) else validate(Design, data, path, source)


def _study(path: Path, source: str, data: dict[str, Any]) -> Study:
    named = data.get("design")
    if not isinstance(named, str):
        given = "missing" if named is None else f"given {named!r}"
        text = f'{given}; give the path of a design file, relative to this file: design = "../designs/gear.toml"'
        raise InputError(toml_errors.format_problems([Problem("design", text)], path, source))
    if "draft" in data:  # the name of this table in version 0.1
        text = "renamed; write [search_accuracy] instead of [draft]"
        raise InputError(toml_errors.format_problems([Problem("draft", text)], path, source))
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
    return validate(Study, {**values, "design": design}, path, source)


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
