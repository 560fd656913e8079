"""What is wrong with a TOML file, said at once: file, line, field, given, allowed, remedy."""

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

# Pydantic ends the place of a fault with the alternative of a union that it tried; no field has such a name.
ALTERNATIVES = ("int", "float", "str")


@dataclass(frozen=True)
class Problem:
    """One thing to put right: dotted field ("" for the whole file) and a sentence with value and remedy."""

    field: str
    text: str


class CrossCheckError(ValueError):
    """Fields that are each in range but contradict each other; raised inside a pydantic validator."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(f"{p.field}: {p.text}" for p in self.problems))


def closest_names(name: str, known: Iterable[str], count: int = 1) -> list[str]:
    """The known spellings nearest to `name`, best first; empty when nothing is near. Case is ignored."""
    by_lower = {word.lower(): word for word in known}
    return [
        by_lower[word]
        for word in difflib.get_close_matches(name.lower(), by_lower, n=count, cutoff=0.6)
    ]


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """'did you mean X?' when something is near; what is allowed when nothing is, or the list is short."""
    words = list(known)
    near = closest_names(name, words)
    listed = f"allowed: {', '.join(words)}"
    if not near:
        return listed
    return f"did you mean {near[0]!r}?" + (f" ({listed})" if len(words) <= 8 else "")


def format_problems(problems: Iterable[Problem], path: Path | None = None, source: str = "") -> str:
    """All problems, a line each: `file:line: field: text`; the line only where the source shows the field."""
    lines = key_lines(source)
    said = []
    for problem in problems:
        line = _line_of(problem.field, lines)
        place = "" if path is None else f"{path}:{line}: " if line else f"{path}: "
        said.append(place + (f"{problem.field}: " if problem.field else "") + problem.text)
    return "\n".join(said)


def explain_validation_error(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Pydantic's findings in the words of the file."""
    problems: list[Problem] = []
    details = error.errors()
    for detail in details:
        loc = detail["loc"]
        if detail["type"] == "too_short" and any(
            other["loc"][: len(loc)] == loc != other["loc"] for other in details
        ):
            continue  # only without its wrong items, which are told
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, CrossCheckError):
            prefix = ".".join(str(step) for step in detail["loc"])
            problems += [
                Problem(".".join(filter(None, (prefix, p.field))), p.text) for p in cause.problems
            ]
        else:
            problems.append(_explain(detail, model))
    return list(dict.fromkeys(problems))  # a union says the same for each of its alternatives


def explain_missing_file(path: Path, what: str, pattern: str) -> str:
    """One sentence on a file that is not there, with the near names that are."""
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: no such {what}; the folder {folder} does not exist"
    there = sorted(p.name for p in folder.glob(pattern) if p.is_file())
    near = closest_names(
        path.stem, (Path(name).stem for name in there)
    )  # the endings are alike and would mislead
    likely = [str(folder / name) for name in there if Path(name).stem in near]
    if likely:
        return f"{path}: no such {what}; did you mean {' or '.join(likely)}?"
    return f"{path}: no such {what}; in {folder} there is {', '.join(there[:8]) or 'none'}"


def numeric_fields(
    table: BaseModel | type[BaseModel], prefix: str = ""
) -> Iterator[tuple[str, FieldInfo]]:
    """Dotted name and field of every number in a table; those of lists by index: part.offset_mm.0.

    Of a class, what its tables can hold; of an instance, the tables of its lists too.
    """
    model = table if isinstance(table, type) else type(table)
    for name, field in model.model_fields.items():
        kinds = _kinds(field.annotation)
        value = None if isinstance(table, type) else getattr(table, name)
        inner = value if isinstance(value, BaseModel) else _table(field)
        if isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for i, item in enumerate(value):
                yield from numeric_fields(item, f"{prefix}{name}.{i}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], tuple):
            yield from (
                (f"{prefix}{name}.{i}.{j}", field)
                for i, row in enumerate(value)
                for j in range(len(row))
            )
        elif inner is not None:
            yield from numeric_fields(inner, f"{prefix}{name}.")
        elif float in kinds or int in kinds:
            yield f"{prefix}{name}", field
        elif isinstance(table, type) or value is not None:
            for kind in kinds:
                if get_args(kind) and all(item is float for item in get_args(kind)):
                    yield from ((f"{prefix}{name}.{i}", field) for i in range(len(get_args(kind))))


def key_lines(source: str) -> dict[str, int]:
    """Line number of every table header and key in a TOML text, by dotted name.

    A plain scan, enough to point a person at the place: inline tables count as their key's line.
    """
    lines: dict[str, int] = {}
    rows: Counter[str] = Counter()
    table = ""
    in_string = ""
    for number, line in enumerate(source.splitlines(), start=1):
        if in_string:
            in_string = "" if in_string in line else in_string
            continue
        header = re.match(r"\s*(\[+)\s*([^\]]+?)\s*\]+\s*(#.*)?$", line)
        key = re.match(
            r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""", line
        )
        if header:
            table = _plain(header[2])
            lines.setdefault(table, number)
            if header[1] == "[[":  # one of a list of tables
                rows[table] += 1
                table = f"{table}.{rows[table] - 1}"
                lines[table] = number
        elif key:
            lines.setdefault(".".join(filter(None, (table, _plain(key[1])))), number)
        for quote in ('"""', "'''"):
            if line.count(quote) % 2:
                in_string = quote
    return lines


def _plain(key: str) -> str:
    return ".".join(step.strip().strip("\"'") for step in key.split("."))


def _line_of(field: str, lines: Mapping[str, int]) -> int | None:
    steps = field.split(".")
    return next(
        (lines[name] for n in range(len(steps), 0, -1) if (name := ".".join(steps[:n])) in lines),
        None,
    )


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """The alternatives of a union, None and what is said of them left out; a plain type alone."""
    is_union = type(None) in get_args(annotation)
    kinds = (
        tuple(k for k in get_args(annotation) if k is not type(None)) if is_union else (annotation,)
    )
    return tuple(get_args(k)[0] if get_origin(k) is Annotated else k for k in kinds)


def _table(field: FieldInfo) -> type[BaseModel] | None:
    for kind in (*_kinds(field.annotation), *get_args(field.annotation)[1:]):
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
    return None


def _row(field: FieldInfo) -> type[BaseModel] | None:
    """The table of each item, where the field is a list of tables."""
    for kind in _kinds(field.annotation):
        items = get_args(kind) if get_origin(kind) is tuple else ()
        if items and isinstance(items[0], type) and issubclass(items[0], BaseModel):
            return items[0]
    return None


def _walk(
    model: type[BaseModel], loc: tuple[int | str, ...]
) -> tuple[type[BaseModel], FieldInfo | None]:
    """The innermost table on the way to `loc`, and the field there when the table knows it."""
    field: FieldInfo | None = None
    free_name = False
    for step in loc:
        if isinstance(step, int) or free_name:
            free_name = False
            continue
        table = model if field is None else _table(field) or _row(field)
        if table is None:
            break
        model, field = table, table.model_fields.get(step)
        if field is None:
            break
        free_name = get_origin(field.annotation) is dict
    return model, field


def describe_allowed(field: FieldInfo) -> str:
    """What a field takes, from its own bounds: 'a number from 2 to 2000 mm (inner height of the chamber)'."""
    bounds = {
        name: getattr(meta, name)
        for meta in field.metadata
        for name in ("ge", "le")
        if hasattr(meta, name)
    }
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    unit = f" {extra['unit']}" if extra.get("unit") else ""
    kinds = _kinds(field.annotation)
    what = f"{extra['form']}" if "form" in extra else ""
    if not what and _table(field):
        what = "a table"
    if not what:
        names = {
            float: "a number",
            int: "a whole number",
            str: "a text in quotes",
            bool: "true or false",
        }
        what = names.get(kinds[0], "")
        if not what and get_args(kinds[0]):
            what = ", ".join(f'"{choice}"' for choice in get_args(kinds[0]))
    if "ge" in bounds and "le" in bounds:
        what += f" from {_bound(bounds['ge'])} to {_bound(bounds['le'])}"
    elif "ge" in bounds:
        what += f" of at least {_bound(bounds['ge'])}"
    about = f" ({field.description})" if field.description else ""
    return what + unit + about


def _bound(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"


def _shown(value: Any) -> str:
    text = ("true" if value else "false") if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _explain(detail: ErrorDetails, model: type[BaseModel]) -> Problem:
    loc = detail["loc"]
    if loc[-1] in ALTERNATIVES:
        loc = loc[:-1]
    dotted = ".".join(str(step) for step in loc)
    table, field = _walk(model, loc)
    kind = detail["type"]
    if kind == "extra_forbidden":
        return Problem(dotted, _unknown_key(str(loc[-1]), table, model))
    if kind == "missing" and field is not None and not isinstance(loc[-1], int):
        return Problem(dotted, f"missing; give {describe_allowed(field)}")
    if field is None:
        return Problem(dotted, f"given {_shown(detail['input'])}: {detail['msg']}")
    if kind == "missing":
        return Problem(
            ".".join(str(s) for s in loc[:-1]), f"too short; allowed: {describe_allowed(field)}"
        )
    if kind in ("value_error", "assertion_error"):  # of a user's own shape
        return Problem(dotted, detail["msg"].partition(", ")[2])
    said = f"given {_shown(detail['input'])}; allowed: {describe_allowed(field)}"
    if kind == "literal_error" and isinstance(detail["input"], str):
        choices = [str(choice) for choice in get_args(_kinds(field.annotation)[0])]
        near = closest_names(detail["input"], choices)
        said += f"; did you mean {near[0]!r}?" if near else ""
    if isinstance(detail["input"], str) and re.fullmatch(r"\s*[-+.\deE]+\s*", detail["input"]):
        said += "; write it without quotes"
    return Problem(dotted, said)


def _unknown_key(key: str, table: type[BaseModel], model: type[BaseModel]) -> str:
    renamed = getattr(table, "RENAMED", {})
    if key in renamed:
        return f"is now called {renamed[key]!r}; rename it"
    near = closest_names(key, table.model_fields)
    if near:
        return f"unknown key; did you mean {near[0]!r}?"
    elsewhere = [name for name in _dotted(model) if name.split(".")[-1].lower() == key.lower()]
    if elsewhere:
        home, _, last = elsewhere[0].rpartition(".")
        return f"unknown key here; did you mean {last!r} {f'in [{home}]' if home else 'above the first [table]'}?"
    return f"unknown key; allowed here: {', '.join(table.model_fields)}"


def _dotted(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    for name, field in model.model_fields.items():
        yield prefix + name
        if (table := _table(field)) is not None:
            yield from _dotted(table, f"{prefix}{name}.")
