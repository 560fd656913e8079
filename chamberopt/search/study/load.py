"""Load study files, and report all problems of a file and its design in one error."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import Problem
from chamberopt.design.design import Design, validate
from chamberopt.design.load import is_study, load_design, read_toml
from chamberopt.search.study.parameters import Varied
from chamberopt.search.study.schema import Study

OF_STUDY = "optimizer."  # how names of a study's own values begin


def load_study(path: str | Path, values: Mapping[str, Any] | None = None) -> Study:
    """Load a study file and the design that it names.

    Raises InputError with every problem of both files, each with its file and line.

    Args:
        values: values in the place of those of the files, by dotted name: of the study's
            [optimizer], and of the design.
    """
    path = Path(path)
    source, data = read_toml(path, "study")
    if not is_study(data):
        text = "this is a design file; a study file is wanted: one with design = ... and [vary]"
        raise InputError(f"{path}: {text}")
    return _study(path, source, data, values)


def load(path: str | Path) -> Design | Study:
    """Load a file that is either a design or a study.

    The file is a study if it names a design, or has a table [vary] or [optimizer].
    """
    path = Path(path)
    source, data = read_toml(path, "design or study")
    return _study(path, source, data) if is_study(data) else validate(Design, data, path, source)


def _study(
    path: Path, source: str, data: dict[str, object], values: Mapping[str, Any] | None = None
) -> Study:
    named = data.get("design")
    if not isinstance(named, str):
        given = "missing" if named is None else f"given {named!r}"
        text = f"{given}; give the path of a design file, relative to this file: "
        problem = Problem("design", f'{text}design = "../designs/gear.toml"')
        raise InputError(toml_errors.format_problems([problem], path, source))
    try:
        data = _with_dotted_names(data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    try:
        design = load_design(Path(os.path.normpath(path.parent / named)))
    except InputError as error:
        problem = Problem("design", f"given {named!r}, which cannot be used:")
        lines = [toml_errors.format_problems([problem], path, source), str(error)]
        raise InputError("\n".join([*lines, *_other_problems(data, path, source)])) from None
    values = values or {}
    if of_design := {k: v for k, v in values.items() if not k.startswith(OF_STUDY)}:
        design = design.changed(of_design)
    if of_study := {k: v for k, v in values.items() if k.startswith(OF_STUDY)}:
        table = data.get("optimizer") or {}
        if isinstance(table, Mapping):
            own = {name.removeprefix(OF_STUDY): value for name, value in of_study.items()}
            data = {**data, "optimizer": {**table, **own}}
    return validate(Study, {**data, "design": design}, path, source)


def _with_dotted_names(data: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a study file, with dotted names as keys of [vary], [constraints] and sums.

    A file may write such names as nested tables: [vary.chamber] with height_mm becomes
    "chamber.height_mm".
    """
    if isinstance(data.get("vary"), Mapping):
        data = {**data, "vary": _flatten(data["vary"], is_table=_varies)}
    if isinstance(data.get("constraints"), Mapping):
        data = {**data, "constraints": _flatten(data["constraints"], is_table=_limits)}
    objective = data.get("objective")
    if isinstance(objective, Mapping) and isinstance(objective.get("sum"), Mapping):
        data = {**data, "objective": {**objective, "sum": _flatten(objective["sum"])}}
    return data


def _other_problems(data: Mapping[str, object], path: Path, source: str) -> list[str]:
    """Return the problems of a study file itself, as texts, where its design cannot be loaded."""
    try:
        Study.model_validate({**data, "design": None}, context={"folder": path.parent})
    except ValidationError as error:
        problems = toml_errors.explain_validation_error(error, Study)
        others = [problem for problem in problems if problem.field != "design"]
        return [toml_errors.format_problems(others, path, source)] if others else []
    return []


def _flatten(
    table: Mapping[str, Any],
    prefix: str = "",
    is_table: Callable[[Mapping[str, Any]], bool] = lambda _: False,
) -> dict[str, Any]:
    """Return a table's values by dotted name; a file may nest tables or write dotted names.

    Args:
        prefix: text before each name.
        is_table: tells whether a mapping is itself a value, such as { min = 0.9 }, and its key thus
            the last part of a name.
    """
    flat: dict[str, Any] = {}
    for name, value in table.items():
        is_prefix = isinstance(value, Mapping) and not is_table(value)
        inner = _flatten(value, f"{prefix}{name}.", is_table) if is_prefix else {}
        found = inner if is_prefix else {prefix + name: value}
        if twice := flat.keys() & found.keys():
            text = f"{min(twice)} is given twice, in quotes and without; leave one out"
            raise InputError(text)
        flat |= found
    return flat


def _limits(table: Mapping[str, object]) -> bool:
    return not table or not all(isinstance(one, Mapping) for one in table.values())


def _varies(table: Mapping[str, object]) -> bool:
    return bool(Varied.model_fields.keys() & table.keys())
