"""Load study files; all problems of a file and of the design it names are reported in one error."""

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
from chamberopt.optimize.study.schema import Study


def load_study(path: str | Path) -> Study:
    """Load a study file and its design; InputError names every problem with file and line."""
    path = Path(path)
    source, data = read_toml(path, "study")
    if not is_study(data):
        text = "this is a design file; a study file is wanted: one with design = ... and [vary]"
        raise InputError(f"{path}: {text}")
    return _study(path, source, data)


def load(path: str | Path) -> Design | Study:
    """Load a design or study file; a study names a design or has [vary]."""
    path = Path(path)
    source, data = read_toml(path, "design or study")
    return _study(path, source, data) if is_study(data) else validate(Design, data, path, source)


def _study(path: Path, source: str, data: dict[str, Any]) -> Study:
    named = data.get("design")
    if not isinstance(named, str):
        given = "missing" if named is None else f"given {named!r}"
        text = f"{given}; give the path of a design file, relative to this file: "
        problem = Problem("design", f'{text}design = "../designs/gear.toml"')
        raise InputError(toml_errors.format_problems([problem], path, source))
    if isinstance(data.get("vary"), Mapping):
        data = {**data, "vary": _flatten(data["vary"])}
    try:
        design = load_design(Path(os.path.normpath(path.parent / named)))
    except InputError as error:
        problem = Problem("design", f"given {named!r}, which cannot be used:")
        lines = [toml_errors.format_problems([problem], path, source), str(error)]
        raise InputError("\n".join([*lines, *_other_problems(data, path, source)])) from None
    return validate(Study, {**data, "design": design}, path, source)


def _other_problems(data: Mapping[str, Any], path: Path, source: str) -> list[str]:
    """Problems of a study file whose design cannot be loaded."""
    try:
        Study.model_validate({**data, "design": None})
    except ValidationError as error:
        problems = toml_errors.explain_validation_error(error, Study)
        others = [problem for problem in problems if problem.field != "design"]
        return [toml_errors.format_problems(others, path, source)] if others else []
    return []


def _flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted names, however they are written: as quoted keys, dotted keys or nested tables."""
    flat: dict[str, Any] = {}
    for name, value in table.items():
        is_table = isinstance(value, Mapping)
        flat |= _flatten(value, f"{prefix}{name}.") if is_table else {prefix + name: value}
    return flat
