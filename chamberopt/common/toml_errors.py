"""Write error messages for TOML files: file, line, field, given value and allowed values.

All problems of a file are reported at once, the first MOST_PROBLEMS problems in words. Messages are
made from the pydantic models of the files, which state the bounds, unit and description of a field.
"""

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
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
BEGINNING = 3  # letters of a wrong name from which on the names that begin so are meant
MAX_VALUE_TEXT = 60  # characters of a given value that a message repeats


@dataclass(frozen=True)
class Problem:
    """A wrong field of a TOML file, which the user must correct, and a text on what is wrong."""

    field: str  # dotted name; "" for the whole file
    text: str  # sentence with the value given and the remedy


class CrossCheckError(ValueError):
    """Error of pydantic validators for values within their ranges that do not fit together."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(f"{p.field}: {p.text}" for p in self.problems))


def closest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the known name most similar to `name`, or None if none is similar. Ignores case."""
    by_lower = {word.lower(): word for word in known}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=SIMILARITY)
    return by_lower[close[0]] if close else None


def _letters(name: str) -> str:
    """Return letters and digits alone of a name, so that "ti6" begins "Ti-6Al-4V"."""
    return re.sub(r"[^a-z0-9.]", "", name.lower())


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint for a wrong name: "did you mean 'x'?" or, without a similar name, all names.

    A hint with a similar name also lists all names if they are few. Where several names begin so,
    it has all of these.

    If a dotted name begins with a known table, only names in this table are compared, because no
    other table has the same keys.
    """
    words, table = list(known), name.rpartition(".")[0]
    words = [one for one in words if table and one.rpartition(".")[0] == table] or words
    longer = [one for one in words if _letters(one).startswith(_letters(name))]
    if 1 < len(longer) <= MAX_CHOICES and len(name) >= BEGINNING:
        return f"did you mean {' or '.join(map(repr, longer))}?"
    close = closest_name(name, words)
    allowed = f"allowed: {', '.join(words)}"
    if close is None:
        return allowed
    return f"did you mean {close!r}?" + (f" ({allowed})" if len(words) <= MAX_CHOICES else "")


def format_problems(problems: Iterable[Problem], path: Path | None = None, source: str = "") -> str:
    """Return lines `file:line: field: text` for the first MOST_PROBLEMS problems of a file.

    A last line counts the further problems.

    Args:
        source: the file's text, in which the lines are looked up.
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
    """Return pydantic's errors as problems of named fields of the file.

    Problems beyond MOST_PROBLEMS, which are only counted, have no texts, because texts take time.

    Args:
        model: pydantic model of the whole file.
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
    """Return a sentence about a file that does not exist, with similar names from its folder.

    Args:
        what: kind of the file, such as "mesh file".
        pattern: pattern of the names that are suggested, such as "*.toml".
    """
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: no such {what}; the folder {folder} does not exist"
    names = sorted(p.name for p in folder.glob(pattern) if p.is_file())
    # The suffixes are left out, because they are alike and would make every name similar.
    close = closest_name(path.stem, (Path(name).stem for name in names))
    likely = [folder / name for name in names if Path(name).stem == close]
    likely = [one for one in likely if one.suffix == path.suffix] or likely
    if likely:
        return f"{path}: no such {what}; did you mean {' or '.join(map(str, likely))}?"
    found = ", ".join(names[:MAX_CHOICES]) or "none"
    place = "this folder" if folder == Path() else folder
    return f"{path}: no such {what}; in {place} there is {found}"


def numeric_fields(
    table: BaseModel | type[BaseModel], prefix: str = ""
) -> Iterator[tuple[str, FieldInfo]]:
    """Yield the dotted name and the pydantic field of every number in a table of a TOML file.

    Numbers in lists have names such as part.offset_mm.0. A model class gives the numbers that its
    tables can hold, but not the numbers in lists of tables. An instance gives these numbers too.

    Args:
        prefix: beginning of all names.
    """
    is_class = isinstance(table, type)
    for name, field in (table if isinstance(table, type) else type(table)).model_fields.items():
        name = prefix + name
        types = _alternatives(field.annotation)
        value = None if is_class else getattr(table, name.removeprefix(prefix))
        inner = value if isinstance(value, BaseModel) else table_of(field)
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
    """Yield the dotted name and the allowed texts of every text field that is a choice.

    Fields that the table leaves empty are skipped. `prefix` is the dotted name of the table.
    """
    for name, field in type(table).model_fields.items():
        allowed = get_args(_alternatives(field.annotation)[0])
        if isinstance(getattr(table, name), str) and len(allowed) > 1:
            yield f"{prefix}.{name}", allowed


def key_lines(source: str) -> dict[str, int]:
    """Return the line number of every table header and key in a TOML text, by dotted name.

    A simple scan is enough to lead a person to a line. It does not find the keys of inline tables.
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
    """Return what a field accepts: 'a number from 2 to 2000 mm (inner height of the chamber)'."""
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    text = accepted_values(field) + (f" {extra['unit']}" if extra.get("unit") else "")
    return text + (f" ({field.description})" if field.description else "")


def accepted_values(field: FieldInfo) -> str:
    """Return what a field accepts, without unit and meaning: 'a number from 2 to 2000'."""
    bounds: dict[str, str] = {}
    for constraint in field.metadata:
        found = ((k, getattr(constraint, k, None)) for k in ("ge", "le"))
        bounds |= {k: str(n) if isinstance(n, int) else f"{n:g}" for k, n in found if n is not None}
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    kind = _alternatives(field.annotation)[0]
    if "form" in extra:
        text = str(extra["form"])
    elif table_of(field):
        text = "a table"
    else:
        text = TYPE_NAMES.get(kind) or ", ".join(f'"{choice}"' for choice in get_args(kind))
    if "ge" in bounds and "le" in bounds:
        text += f" from {bounds['ge']} to {bounds['le']}"
    elif "ge" in bounds:
        text += f" of at least {bounds['ge']}"
    return text


def _dotted(loc: tuple[int | str, ...]) -> str:
    return ".".join(str(step) for step in loc)


def _without_quotes(key: str) -> str:
    return ".".join(step.strip().strip("\"'") for step in key.split("."))


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    """Return the types that a field accepts besides None, without their annotations.

    A type that does not allow None is returned alone, also if it is a union.
    """
    return _found_alternatives(annotation)


@cache
def _found_alternatives(annotation: Any) -> tuple[Any, ...]:
    types = get_args(annotation)
    types = tuple(t for t in types if t is not type(None)) if type(None) in types else (annotation,)
    return tuple(map(_bare, types))


def _bare(annotation: Any) -> Any:
    """Return the type T of Annotated[T, ...]; other types stay as they are."""
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation


def table_of(field: FieldInfo, of_rows: bool = False) -> type[BaseModel] | None:
    """Return the pydantic model of a field that is a table, or None for other fields.

    With `of_rows`, a field that is a list of tables gives the model of these tables.
    """
    annotation: Any = field.annotation
    return _found_table(annotation, of_rows)


@cache
def _found_table(annotation: Any, of_rows: bool) -> type[BaseModel] | None:
    types = (*_alternatives(annotation), *map(_bare, get_args(annotation)[1:]))
    if of_rows:
        lists = (t for t in _alternatives(annotation) if get_origin(t) is tuple)
        types = tuple(item for one in lists for item in get_args(one)[:1])
    return next((t for t in types if isinstance(t, type) and issubclass(t, BaseModel)), None)


def _find_field(
    model: type[BaseModel], loc: tuple[int | str, ...]
) -> tuple[type[BaseModel], FieldInfo | None]:
    """Return the model of the innermost table that contains a field, and the field.

    The field is None if the table does not have it.

    Args:
        model: pydantic model of the whole file.
        loc: names and list positions that lead to the field.
    """
    field: FieldInfo | None = None
    free_name = False  # the next step is a key that the user chooses
    for step in loc:
        if isinstance(step, int) or free_name:
            free_name = False
            continue
        table = model if field is None else table_of(field) or table_of(field, of_rows=True)
        if table is None:
            break
        model, field = table, table.model_fields.get(step)
        if field is None:
            break
        free_name = get_origin(field.annotation) is dict
    return model, field


def _format_value(value: object) -> str:
    return _shortened(str(value).lower() if isinstance(value, bool) else repr(value))


def _shortened(text: str, most: int = MAX_VALUE_TEXT) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


def _without_alternative(loc: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return the names that lead to a field, without a type name that pydantic appended.

    For a union of types, pydantic appends the type that it tried, such as "float".
    """
    return loc[:-1] if loc[-1:] and loc[-1] in ALTERNATIVES else loc


def _explain(detail: ErrorDetails, model: type[BaseModel]) -> Problem:
    """Return one of pydantic's errors as a problem of a named field of the file.

    Args:
        model: pydantic model of the whole file.
    """
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
    """Return a hint for an unknown key: its new name, a similar key, its table or the allowed keys.

    Args:
        table: model of the table that holds the key.
        model: model of the whole file.

    A model lists former names of its keys in RENAMED, and what became of removed keys in REMOVED.
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
    """Yield the dotted names of all keys of a model and its tables."""
    for name, field in model.model_fields.items():
        yield prefix + name
        if (table := table_of(field)) is not None:
            yield from _all_names(table, f"{prefix}{name}.")
