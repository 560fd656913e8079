"""Error messages for TOML files: file, line, field, given value, allowed values and a remedy.

All problems of a file are reported at once, the first MOST_PROBLEMS problems in words. Messages are
made from the pydantic models of the files. A field's bounds, unit and description are stated once,
in its model.
"""

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

# For a union, pydantic ends the location of an error with the alternative that it tried. No field
# has such a name.
ALTERNATIVES = ("int", "float", "str")
TYPE_NAMES = {
    float: "a number",
    int: "a whole number",
    str: "a text in quotes",
    bool: "true or false",
}
# similarity of two spellings, from 0 to 1 (difflib's ratio): below it a hint would mislead
SIMILARITY = 0.6
MOST_PROBLEMS = 10  # problems listed in a message
MAX_NAME_TEXT = 200  # characters of a field's name that a message repeats
MAX_CHOICES = 8  # choices listed in a message
MAX_VALUE_TEXT = 60  # characters of a given value that a message repeats


@dataclass(frozen=True)
class Problem:
    """A problem of a field that the user must correct."""

    field: str  # dotted name; "" for the whole file
    text: str  # sentence with the value given and the remedy


class CrossCheckError(ValueError):
    """Error of pydantic validators for fields in range that contradict each other."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(f"{p.field}: {p.text}" for p in self.problems))


def closest_name(name: str, known: Iterable[str]) -> str | None:
    """The known name most similar to `name`, if any is similar; case is ignored."""
    by_lower = {word.lower(): word for word in known}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=SIMILARITY)
    return by_lower[close[0]] if close else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint: "did you mean 'x'?", the allowed names, or both if there are few.

    A dotted name with a known table is compared only within this table, because no other table has
    the same keys.
    """
    words, table = list(known), name.rpartition(".")[0]
    words = [one for one in words if table and one.rpartition(".")[0] == table] or words
    close = closest_name(name, words)
    allowed = f"allowed: {', '.join(words)}"
    if close is None:
        return allowed
    return f"did you mean {close!r}?" + (f" ({allowed})" if len(words) <= MAX_CHOICES else "")


def format_problems(problems: Iterable[Problem], path: Path | None = None, source: str = "") -> str:
    """Lines `file:line: field: text` for the first problems, and the number of further problems.

    Args:
        source: the file's text.
    """
    line_of = key_lines(source)
    texts, problems = [], list(problems)
    for problem in problems[:MOST_PROBLEMS]:
        # Line of the field, or of the innermost table around the field that the file has.
        steps = problem.field.split(".")
        names = (".".join(steps[:n]) for n in range(len(steps), 0, -1))
        line = next((line_of[name] for name in names if name in line_of), None)
        place = "" if path is None else f"{path}:{line}: " if line else f"{path}: "
        field = _shortened(problem.field, MAX_NAME_TEXT)
        texts.append(place + (f"{field}: " if field else "") + problem.text)
    if (more := len(problems) - MOST_PROBLEMS) > 0:
        texts.append(f"and {more:,} more; put these right first")
    return "\n".join(texts)


def explain_validation_error(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Pydantic's errors as problems in the words of the file.

    Words take time. Problems beyond MOST_PROBLEMS are counted and have no words.
    """
    problems: dict[Problem, None] = {}  # a union reports the same error for each alternative
    details = error.errors(include_url=False)
    for detail in details:
        loc = detail["loc"]
        if len(problems) > MOST_PROBLEMS:
            problems[Problem(_dotted(_without_alternative(loc)), "")] = None
            continue
        if detail["type"] == "too_short" and any(
            one["loc"] != loc and one["loc"][: len(loc)] == loc for one in details
        ):
            continue  # the list is only too short because its wrong items do not count
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, CrossCheckError):
            place = _dotted(loc)
            inside = ((".".join(filter(None, (place, p.field))), p.text) for p in cause.problems)
            problems |= dict.fromkeys(Problem(*one) for one in inside)
        else:
            problems[_explain(detail, model)] = None
    return list(problems)


def explain_missing_file(path: Path, what: str, pattern: str) -> str:
    """One sentence about a file that does not exist, with similar names from its folder."""
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: no such {what}; the folder {folder} does not exist"
    names = sorted(p.name for p in folder.glob(pattern) if p.is_file())
    # The suffixes are left out, because they are alike and would make every name similar.
    close = closest_name(path.stem, (Path(name).stem for name in names))
    likely = [str(folder / name) for name in names if Path(name).stem == close]
    if likely:
        return f"{path}: no such {what}; did you mean {' or '.join(likely)}?"
    found = ", ".join(names[:MAX_CHOICES]) or "none"
    place = "this folder" if folder == Path() else folder
    return f"{path}: no such {what}; in {place} there is {found}"


def numeric_fields(
    table: BaseModel | type[BaseModel], prefix: str = ""
) -> Iterator[tuple[str, FieldInfo]]:
    """Dotted name and field of every number in a table; in lists such as part.offset_mm.0.

    For a model class the result has the numbers that its tables can hold. For an instance it
    includes the tables of its lists.
    """
    is_class = isinstance(table, type)
    for name, field in (table if isinstance(table, type) else type(table)).model_fields.items():
        name = prefix + name
        types = _alternatives(field.annotation)
        value = None if is_class else getattr(table, name.removeprefix(prefix))
        inner = value if isinstance(value, BaseModel) else _table_of(field)
        items = value if isinstance(value, tuple) and value else (None,)
        if isinstance(items[0], BaseModel):
            for i, item in enumerate(items):
                yield from numeric_fields(item, f"{name}.{i}.")
        elif isinstance(items[0], tuple):
            for i, row in enumerate(items):
                yield from ((f"{name}.{i}.{j}", field) for j in range(len(row)))
        elif inner is not None:
            yield from numeric_fields(inner, f"{name}.")
        elif float in types or int in types:
            yield name, field
        elif is_class or value is not None:
            for parts in map(get_args, types):
                if parts and all(part is float for part in parts):
                    yield from ((f"{name}.{i}", field) for i in range(len(parts)))


def text_choices(table: BaseModel, prefix: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Dotted name and allowed texts of every set text of a table that has few allowed texts."""
    for name, field in type(table).model_fields.items():
        allowed = get_args(_alternatives(field.annotation)[0])
        if isinstance(getattr(table, name), str) and len(allowed) > 1:
            yield f"{prefix}.{name}", allowed


def key_lines(source: str) -> dict[str, int]:
    """Line number of every table header and key in a TOML text, by dotted name.

    A simple scan is enough to point a person at the place. It does not find the keys of inline
    tables.
    """
    lines: dict[str, int] = {}
    rows: Counter[str] = Counter()
    table = in_string = ""
    word = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
    for number, line in enumerate(source.splitlines(), start=1):
        if in_string:
            in_string = "" if in_string in line else in_string
            continue
        header = re.match(r"\s*(\[+)\s*([^\]]+?)\s*\]+\s*(#.*)?$", line)
        key = re.match(rf"\s*({word}(?:\s*\.\s*{word})*)\s*=", line)
        if header:
            table = _without_quotes(header[2])
            lines.setdefault(table, number)
            if header[1] == "[[":  # a table in a list of tables
                rows[table] += 1
                table = f"{table}.{rows[table] - 1}"
                lines[table] = number
        elif key:
            name = _without_quotes(key[1])
            lines.setdefault(f"{table}.{name}" if table else name, number)
        for quote in ('"""', "'''"):
            if line.count(quote) % 2:
                in_string = quote
    return lines


def describe_allowed(field: FieldInfo) -> str:
    """Values that a field accepts: 'a number from 2 to 2000 mm (inner height of the chamber)'."""
    bounds: dict[str, str] = {}
    for constraint in field.metadata:
        found = ((k, getattr(constraint, k, None)) for k in ("ge", "le"))
        bounds |= {k: str(n) if isinstance(n, int) else f"{n:g}" for k, n in found if n is not None}
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    kind = _alternatives(field.annotation)[0]
    if "form" in extra:
        text = str(extra["form"])
    elif _table_of(field):
        text = "a table"
    else:
        text = TYPE_NAMES.get(kind) or ", ".join(f'"{choice}"' for choice in get_args(kind))
    if "ge" in bounds and "le" in bounds:
        text += f" from {bounds['ge']} to {bounds['le']}"
    elif "ge" in bounds:
        text += f" of at least {bounds['ge']}"
    text += f" {extra['unit']}" if extra.get("unit") else ""
    return text + (f" ({field.description})" if field.description else "")


def _dotted(loc: tuple[int | str, ...]) -> str:
    return ".".join(str(step) for step in loc)


def _without_quotes(key: str) -> str:
    return ".".join(step.strip().strip("\"'") for step in key.split("."))


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    """The types of an optional field, without None and annotations; otherwise the type itself."""
    types = get_args(annotation)
    types = tuple(t for t in types if t is not type(None)) if type(None) in types else (annotation,)
    return tuple(map(_bare, types))


def _bare(annotation: Any) -> Any:
    """A type without its annotations."""
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation


def _table_of(field: FieldInfo, of_rows: bool = False) -> type[BaseModel] | None:
    """Model of a field that is a table, or of the rows of a list of tables."""
    types = (*_alternatives(field.annotation), *map(_bare, get_args(field.annotation)[1:]))
    if of_rows:
        lists = (t for t in _alternatives(field.annotation) if get_origin(t) is tuple)
        types = tuple(item for one in lists for item in get_args(one)[:1])
    return next((t for t in types if isinstance(t, type) and issubclass(t, BaseModel)), None)


def _find_field(
    model: type[BaseModel], loc: tuple[int | str, ...]
) -> tuple[type[BaseModel], FieldInfo | None]:
    """The innermost table on the way to `loc`, and the field there if the table has it."""
    field: FieldInfo | None = None
    free_name = False  # the next step is a key that the user chooses
    for step in loc:
        if isinstance(step, int) or free_name:
            free_name = False
            continue
        table = model if field is None else _table_of(field) or _table_of(field, of_rows=True)
        if table is None:
            break
        model, field = table, table.model_fields.get(step)
        if field is None:
            break
        free_name = get_origin(field.annotation) is dict
    return model, field


def _format_value(value: Any) -> str:
    return _shortened(str(value).lower() if isinstance(value, bool) else repr(value))


def _shortened(text: str, most: int = MAX_VALUE_TEXT) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


def _without_alternative(loc: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """The place of a field, without the alternative of its union that pydantic tried."""
    return loc[:-1] if loc[-1:] and loc[-1] in ALTERNATIVES else loc


def _explain(detail: ErrorDetails, model: type[BaseModel]) -> Problem:
    """One of pydantic's errors in the words of the file."""
    loc, kind, value = _without_alternative(detail["loc"]), detail["type"], detail["input"]
    name = _dotted(loc)
    table, field = _find_field(model, loc)
    if kind == "extra_forbidden":
        return Problem(name, _explain_unknown_key(str(loc[-1]), table, model))
    if kind == "missing" and field is not None and not isinstance(loc[-1], int):
        return Problem(name, f"missing; give {describe_allowed(field)}")
    if field is None:
        return Problem(name, f"given {_format_value(value)}: {detail['msg']}")
    if kind == "missing":
        return Problem(_dotted(loc[:-1]), f"too short; allowed: {describe_allowed(field)}")
    if kind == "too_long" and isinstance(value, dict):
        most = detail["ctx"]["max_length"]
        return Problem(
            name, f"has {len(value):,} names, at most {most} are allowed; leave some out"
        )
    if kind in ("value_error", "assertion_error"):  # raised by a user's own shape
        return Problem(name, detail["msg"].partition(", ")[2])
    text = f"given {_format_value(value)}; allowed: {describe_allowed(field)}"
    if kind == "literal_error" and isinstance(value, str):
        choices = map(str, get_args(_alternatives(field.annotation)[0]))
        close = closest_name(value, choices)
        text += f"; did you mean {close!r}?" if close else ""
    if isinstance(value, str) and re.fullmatch(r"\s*[-+.\deE]+\s*", value):
        text += "; write it without quotes"
    return Problem(name, text)


def _explain_unknown_key(key: str, table: type[BaseModel], model: type[BaseModel]) -> str:
    """Hint for an unknown key: its new name, a similar key, its place, or the allowed keys.

    A model lists former names of its keys in RENAMED, and the fate of removed keys in REMOVED.
    """
    renamed, removed = getattr(table, "RENAMED", {}), getattr(table, "REMOVED", {})
    if key in renamed:
        return f"is now called {renamed[key]!r}; rename it"
    if key in removed:
        return f"{removed[key]}; leave it out"
    close = closest_name(key, table.model_fields)
    if close:
        return f"unknown key; did you mean {close!r}?"
    for name in _all_names(model):
        home, _, last = name.rpartition(".")
        if last.lower() == key.lower():
            place = f"in [{home}]" if home else "above the first [table]"
            allowed = f"allowed here: {', '.join(table.model_fields)}"
            return f"unknown key here; did you mean {last!r} {place}? ({allowed})"
    return f"unknown key; allowed here: {', '.join(table.model_fields)}"


def _all_names(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Dotted names of all keys of a model and its tables."""
    for name, field in model.model_fields.items():
        yield prefix + name
        if (table := _table_of(field)) is not None:
            yield from _all_names(table, f"{prefix}{name}.")
