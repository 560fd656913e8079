"""Change the text of the design file that a page edits, list its fields, and save it."""

from __future__ import annotations

import hashlib
import re
import stat
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from datetime import date
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from chamberopt.common.errors import InputError
from chamberopt.common.files import claim_file, open_plain, write_bytes
from chamberopt.common.key_words import inner_first, key_in_words, title, title_with_unit, unit_of
from chamberopt.common.limits import MAX_TEXT_BYTES
from chamberopt.common.toml_errors import text_choices
from chamberopt.common.toml_fields import read_toml
from chamberopt.design.design import Design, validate
from chamberopt.design.fixture import HOLDER_KEYS, Holder
from chamberopt.design.materials import BY_NAME, SURFACES, alloys
from chamberopt.design.shapes.base import is_custom
from chamberopt.page.page_words import choices, on_page
from chamberopt.page.structure import (
    KEPT,
    KIND,
    MASK_KIND,
    NO_HOLDER,
    NO_MASK,
    OF_MASK,
    SHAPE,
    mask_kind,
    may_change,
    structure_choices,
)

# New values of keys by their dotted names, in the file's units; None takes a key out of the file.
Changes = Mapping[str, Any]
LONGEST_SAVE_S = 5.0  # wait for another page's save, which takes a tenth of a second
LATE_WRITE_S = 0.05  # an editor takes far less from opening a file to writing it
FACETS, ACCURACY = "chamber.facets", "process.accuracy"  # a number, and where it is shown
# A proposed design begins with this; the comment behind each number is then the reason for it.
PROPOSED = "proposed by `chamberopt new`"
CHANGED = "changed by you; proposed was "  # and the value, before the reason behind that
INTENSITY_LINE = re.compile(r"^# Almen intensity: (.+)$|^intensity_mmA = .*?# (.+)$", re.MULTILINE)
TO_SETTLE, SETTLED = "to_settle", "settled"  # the page moves what is settled to the second list
# Tables that what is to be settled of a proposal is told of; a matter says which were changed.
OF_MATTERS = "part", "chamber", "sonotrode", "shot", "holder", "mask", "materials"
SINCE, ADVICE = "CHANGED SINCE IT WAS PROPOSED: ", "; settle what else is listed if it still holds"
# Keys that the page changes beside its fields: zones, and the faces of target, zone or fixture.
PICKED = re.compile(
    r"(part\.target|zones\.\d+\.target|holder\.at|mask\.at)"
    rf"\.(surface|faces|direction|angle_deg|box_mm|radius_mm|cut)|zones\.\d+|{TO_SETTLE}"
)


class EditedFile:
    """The text of a design file as a page in the browser has read it, and methods to change it.

    Args:
        path: the design file.
        trusted: whether the chamber's shape in the design may be a Python file, which is then run.

    Raises:
        InputError: the file is a link or no valid design, or its shape is not trusted.
    """

    def __init__(self, path: Path, trusted: bool) -> None:
        if path.is_symlink():
            raise InputError(f"{path}: is a link; give the file that it leads to: {path.resolve()}")
        self.path = path.resolve()
        self.text, data = read_toml(self.path, "design")
        self._shape = custom_shape(data)
        if self._shape and not trusted:
            raise InputError(
                f"{path.name}: runs the Python file {self._shape}, which may do anything; read it, "
                "and begin again with --trust-shape if you trust it"
            )
        self.design = validate(Design, data, self.path, self.text)
        self.structure = structure_choices(self.design)

    @property
    def folder(self) -> Path:
        return self.path.parent

    @property
    def digest(self) -> str:
        """The sha256 digest of the text, by which a page names the text that it read."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def with_changes(self, changes: Changes) -> Design:
        """Return the design with some values changed; `changes` has new values by dotted name.

        Raises InputError, which names every problem, if the changed design is not valid.
        """
        text = self.changed_text(changes)
        return validate(Design, tomllib.loads(text), self.path, text)

    def changed(self, changes: Changes) -> EditedFile:
        """Return the file as it would be with some values changed, to list its fields.

        Raises InputError, which names every problem, if the changed design is not valid.
        """
        made = copy(self)
        made.text, made.design = self.changed_text(changes), self.with_changes(changes)
        made.structure = self.structure | structure_choices(made.design)
        return made

    def changed_text(self, changes: Changes) -> str:
        """Return the text of the file with some values changed.

        Comments, order and other lines stay, but that the reason behind a proposed number says of
        what number it was. `changes` has new values by dotted name.

        Raises:
            InputError: the page may not change a key, or the key stands in the file in a form that
                cannot be changed alone.
        """
        import tomlkit
        from tomlkit.exceptions import TOMLKitError

        if KEPT in changes:
            others = {name: value for name, value in changes.items() if name != KEPT}
            return self.with_steps(changes[KEPT]).changed_text(others)
        document, known = tomlkit.parse(self.text), {*field_names(self.design), *self.alloys()}
        # What is taken out goes first: it may be chosen anew after that.
        for name, value in sorted(changes.items(), key=lambda one: one[1] not in (None, "")):
            is_own = name in known or PICKED.fullmatch(name)
            if not is_own and not may_change(self.design, name, value):
                raise InputError(f"{name}: not changed on the page; change it in the file")
            try:
                if (name, value) in ((KIND, NO_HOLDER), (MASK_KIND, NO_MASK)):
                    self._change(document, name.split(".")[0], None)
                elif name != MASK_KIND:  # the keys that make it this kind come with it
                    self._change(document, name, value)
                    if name in (SHAPE, KIND):  # the reason behind it was that of another one
                        document[name.split(".")[0]][name.split(".")[1]].trivia.comment = ""
            except (TOMLKitError, ValueError, TypeError, AttributeError, IndexError) as error:
                raise InputError(
                    f"{name}: the page cannot change it where the file says it ({error}); write "
                    "its table with a header of its own, as [part.target]"
                ) from None
        if self.is_proposed:
            for name in changes.keys() & known:
                _keep_reason_true(tomlkit.parse(self.text), document, name)
            _keep_matters_true(document, changes)
        return tomlkit.dumps(document) if changes else self.text

    @property
    def is_proposed(self) -> bool:
        """True if the comments in the file are reasons of the values that were proposed."""
        return PROPOSED in self.text.partition("\n")[0]

    @property
    def proposed_intensity(self) -> list[str]:
        """The Almen intensity that was proposed, and what is usual; [] if that may hold no more.

        It stands behind a wanted intensity, or in a line of its own.
        """
        found = INTENSITY_LINE.search(self.text)
        if not self.is_proposed or found is None or CHANGED in self.text or SINCE in self.text:
            return []
        return (found[1] or found[2]).split("; ")[:2]

    def with_steps(self, kept: Sequence[int]) -> EditedFile:
        """Return the file as it would be with some of its steps alone.

        Args:
            kept: their numbers, in order; empty for none.
        """
        import tomlkit

        steps, document = self.design.steps or (), tomlkit.parse(self.text)
        for k in reversed(range(len(steps))):
            if k not in kept:
                del document["steps"][k]
        left = tuple(steps[k] for k in kept)
        if not left:
            document.pop("steps", None)
        made = copy(self)
        made.text = tomlkit.dumps(document)
        made.design = self.design.model_copy(update={"steps": left or None})
        return made

    def save(self, changes: Changes) -> None:
        """Write the file with some values changed; `changes` has new values by dotted name.

        Raises:
            InputError: the file has changed since it was read, is read-only, or would be no valid
                design; it stays as it is.
        """
        text = self.changed_text(changes)
        self.with_changes(changes)
        if not self.path.stat().st_mode & stat.S_IWUSR:
            raise InputError(f"{self.path.name}: is read-only; allow writing, or save a copy")
        with claim_file(self.path, wait=LONGEST_SAVE_S):
            self._require_unchanged(self.path)
            write_bytes(self.path, text.encode(), self._look_at_replaced)

    def _look_at_replaced(self, path: Path) -> None:
        """Raise InputError unless the file to be replaced still holds the text that was read."""
        time.sleep(LATE_WRITE_S)  # an editor that opened the file before may write to it now
        self._require_unchanged(path)

    def _require_unchanged(self, path: Path) -> None:
        try:
            with open_plain(path) as file:
                content = file.read(MAX_TEXT_BYTES)
        except FileNotFoundError:
            content = b""
        if content.decode("utf-8-sig", errors="replace") != self.text:
            raise InputError(
                f"{self.path.name}: changed on disk since this page read it, so it is not "
                "replaced; reload the page to go on from what it says now"
            )

    def alloys(self) -> dict[str, str]:
        """Return the names of alloys that the file gives, by the dotted names of their keys."""
        found, tables = {}, tomllib.loads(self.text).get("materials", {})
        for name, given in tables.items() if isinstance(tables, dict) else ():
            if name in SURFACES and isinstance(given, str):
                found[f"materials.{name}"] = given
            elif name in SURFACES and isinstance(given, dict) and "alloy" in given:
                found[f"materials.{name}.alloy"] = str(given["alloy"])
        return found

    def is_fixed(self, name: str) -> bool:
        """Return True if a number cannot be edited because its table is given by a name.

        For example, the name of a metal stands for the table of its numbers. Friction that the file
        does not give is given by a name too.
        """
        inner: Any = tomllib.loads(self.text)
        for step in name.split(".")[:-1]:
            if step in BY_NAME and isinstance(inner, dict) and step not in inner:
                return True
            inner = inner.get(step, {}) if isinstance(inner, dict) else {}
            if isinstance(inner, str):
                return True
        return False

    def _change(self, document: Any, name: str, value: Any) -> None:
        """Set or remove a key in the parsed TOML file, and make the missing tables around it."""
        import tomlkit

        steps, table = name.split("."), document
        for k, step in enumerate(steps[:-1]):
            if isinstance(table, list):
                table = table[int(step)]
                continue
            if step not in table:
                if value is None:
                    return
                if steps[k + 1].isdecimal():  # a list that the file leaves at its default
                    present = list(self._present(steps[: k + 1]) or ())
                    table[step] = present or tomlkit.aot()
                else:
                    table.append(step, tomlkit.table())
            table = table[step]
            if not isinstance(table, dict | list):
                text = f"given {table!r}, which is no table; change it in the file"
                raise InputError(f"{'.'.join(steps[: k + 1])}: {text}")
        last = steps[-1]
        if value is None:
            if isinstance(table, list):
                raise InputError(f"{name}: nothing given; give a number")
            if last in table:
                del table[last]
        elif name == TO_SETTLE:
            for k in reversed(range(len(table[last]))):
                if table[last][k] not in value:
                    _record_settled(table, str(table[last][k]))
                    del table[last][k]
        elif not isinstance(table, list):
            table[last] = _inline(value)
        elif int(last) < len(table):
            table[int(last)] = value
        else:  # a further table, such as a zone
            table.append(_table(value))

    def _present(self, steps: list[str]) -> Any:
        """Return a value of the design.

        Args:
            steps: its dotted name, split at the dots.
        """
        value: Any = self.design
        for step in steps:
            value = getattr(value, step)
        return value


def _keep_reason_true(before: Any, after: Any, name: str) -> None:
    """Let the comment behind a changed value say which value it was the reason of.

    Args:
        before, after: the parsed file as it is and as it would be.
        name: dotted name of the value; of an item of a list, the reason is behind the list.
    """
    steps = [step for step in name.split(".") if not step.isdecimal()]
    for step in steps:
        before, after = (
            one.get(step) if isinstance(one, Mapping) else None for one in (before, after)
        )
    if before is None or after is None or not before.trivia.comment:
        return
    reason = before.trivia.comment.lstrip("#").strip()
    proposed = before.as_string()
    if reason.startswith(CHANGED):
        proposed, _, reason = reason.removeprefix(CHANGED).partition(": ")
    is_back = after.as_string() == proposed
    after.trivia.comment = f"# {reason}" if is_back else f"# {CHANGED}{proposed}: {reason}"


def _keep_matters_true(document: Any, changes: Changes) -> None:
    """Let what is to be settled say which values that it was told of were changed.

    Args:
        document: the parsed file as it would be.
    """
    matters = document.get(TO_SETTLE, [])
    found = [one for one in matters if one.startswith(SINCE)]
    names = found[0][len(SINCE) : -len(ADVICE)].split(", ") if found else []
    changed = (name.split(".")[:2] for name in sorted(changes))
    names += [key_in_words(".".join(steps)) for steps in changed if steps[0] in OF_MATTERS]
    if found:
        del matters[matters.index(found[0])]
    if names and len(matters):
        matters.insert(0, f"{SINCE}{', '.join(dict.fromkeys(names))}{ADVICE}")


def _record_settled(document: Any, text: str) -> None:
    """Note in a parsed design that a matter is settled, and on which day."""
    import tomlkit

    if text.startswith(SINCE):  # it told of the other matters
        return
    if SETTLED not in document:
        document[SETTLED] = tomlkit.array().multiline(True)
    document[SETTLED].append(f"{text} (marked as settled on {date.today():%Y-%m-%d})")


def alloy_suggestions() -> list[tuple[str, str]]:
    """Return the name of each alloy of the catalogue, and what metal it is."""
    return [(one.name, one.metal) for one in alloys()]


def custom_shape(data: Mapping[str, object]) -> str:
    """Return the Python file that a design names as its chamber's shape, or "" for other shapes.

    `data` is the content of the design file.
    """
    chamber = data.get("chamber")
    shape = chamber.get("shape") if isinstance(chamber, Mapping) else None
    return str(shape) if is_custom(shape) else ""


def _inline(value: object) -> object:
    """Return a value so that a TOML file has each table in it on one line.

    A value without tables is returned as it is.
    """
    import tomlkit

    if isinstance(value, dict):
        row = tomlkit.inline_table()
        row.update({key: _inline(inner) for key, inner in value.items()})
        return row
    if not (isinstance(value, list) and value and isinstance(value[0], dict)):
        return value
    rows = tomlkit.array()
    for one in value:
        rows.append(_inline(one))
    return rows.multiline(len(value) > 1)


def _table(value: dict[str, object]) -> object:
    import tomlkit

    table = tomlkit.table()
    table.update({key: _inline(inner) for key, inner in value.items()})
    return table


# Fields of the page: each number and choice of a design with unit, bounds and description.

SHARE = "_share"  # end of the name of a share
# Numbers for which the page offers that a study varies them; a study file may vary others too.
DESIGNED = re.compile(
    r"(steps\.\d+\.)?(chamber|sonotrode|shot|holder|mask|effects\.part_turn|part\.rotate_deg"
    r"|part\.offset_mm)\.|(steps\.\d+\.)?(process\.treatment_time_s|time_share)$"
)
# Tables without fields: their numbers are measured, or chosen by clicks on the part, or mesh the
# part, which would become another part.
NOT_SHOWN = (
    "calibration.", "part.target.", "zones.", "tolerances.", "ranges.", "part.tessellation.",
    "holder.at.", "mask.at.",
)  # fmt: skip


def design_fields(file: EditedFile) -> list[dict[str, object]]:
    """Return what the page shows of each number and choice in a design, in the order of the file.

    The facets of a round wall come last, as they are a number of the accuracy.

    Each row has the name, also in words, value, unit, allowed range and explanation, and the reason
    that the file has behind it.
    """
    design, varied = file.design, {*filter(_is_designed, file.design.numbers())}
    reasons = comments(file.text)
    rows: list[dict[str, Any]] = []
    named = [
        {
            "name": name,
            "value": value,
            "suggestions": alloy_suggestions(),
            "text": f"alloy of the {name.split('.')[1]}",
            "reason": reasons.get(name, ""),
        }
        for name, value in file.alloys().items()
    ]
    for name, field in _numbers(design):
        if name.startswith("materials."):  # the alloys stand before their numbers
            rows, named = rows + named, []
        row: dict[str, Any] = {"name": name, "value": _value(design, name), **_bounds(field)}
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        unit = extra.get("unit", "") or unit_of(name)
        # A file has shares as fractions, or as parts of a sum.
        row |= {"unit": "" if name.endswith(SHARE) else unit, "text": field.description or ""}
        row |= {"whole": field.annotation is int, "varies": name in varied}
        row |= {"fixed": file.is_fixed(name)}
        rows.append(row | {"reason": reasons.get(name.removesuffix(".0"), "")})
    for name, allowed in _choices(design).items():
        table, key = name.split(".")
        text = type(getattr(design, table)).model_fields[key].description or ""
        row = {
            "name": name,
            "value": design.setting(name),
            "choices": choices(name, allowed),
            "text": text,
        }
        row |= {"reason": reasons.get(name, "")}
        rows.append(row)
    return [
        row
        | _words(design, row["name"])
        | {"reason": on_page(_new(row["reason"], row["text"])), "text": on_page(row["text"])}
        for row in [*_structure_rows(file), *sorted(rows, key=lambda row: row["name"] == FACETS)]
    ]


def _is_designed(name: str) -> bool:
    """Return whether a number is one of process or geometry, which a designer may choose.

    Metals are what they are, and settings of the simulation say how sure its figures are.
    """
    return bool(DESIGNED.match(name)) and name != "shot.density_kg_m3"


def _new(reason: str, text: str) -> str:
    """Return a reason, or "" if it has no word that the explanation of its number has not."""
    own, known = ({*re.findall(r"\w{4,}", one.lower())} for one in (reason, text))
    return "" if own and own <= known else reason


def _words(design: Design, name: str) -> dict[str, str]:
    """Return the table of a number or choice and its name in it, in words, and both as one."""
    steps = name.split(".")
    depth = 2 if name.startswith(("process.accuracy.", "steps.")) else 1
    table, key = ".".join(steps[:depth]), ".".join(steps[depth:])
    table = ACCURACY if name == FACETS else table
    group = inner_first(table)
    if steps[0] == "steps":
        group = f"step {(design.steps or ())[int(steps[1])].title}"
    return {
        "table": table,
        "group": group[0].upper() + group[1:],
        "label": f"{title(key)} share" if key.endswith(SHARE) else title(key),
        "in_full": title(name) if key.endswith(SHARE) else title_with_unit(name),
    }


def _structure_rows(file: EditedFile) -> Iterator[dict[str, Any]]:
    """Yield what the page shows of the chamber's shape and the kinds of holder and mask."""
    holder, chamber = file.design.holder, file.design.chamber
    values = {SHAPE: chamber.shape, KIND: NO_HOLDER if holder is None else holder.kind}
    values |= {MASK_KIND: mask_kind(file.design)}
    texts = {SHAPE: "the sizes that it needs are proposed", KIND: "what holds the part"}
    texts |= {MASK_KIND: "what keeps the shot from the faces that it covers"}
    reasons = comments(file.text)
    for name, allowed in file.structure.items():
        row = {"name": name, "value": values[name], "choices": choices(name, allowed)}
        yield row | {"text": texts[name]} | {"reason": reasons.get(name, ""), "is_structure": True}


def comments(text: str) -> dict[str, str]:
    """Return what the comment behind each key of a TOML file says, by the key's dotted name.

    In a proposed design this is the reason of the key's value. A key without comment is left out.
    """
    import tomlkit
    from tomlkit.items import Table

    def walk(table: Any, before: str) -> Iterator[tuple[str, str]]:
        for key, item in table.items():
            name = f"{before}{key}"
            if isinstance(item, Table):
                yield from walk(item, f"{name}.")
            elif hasattr(item, "trivia"):
                yield name, item.trivia.comment.lstrip("#").strip()

    return {name: comment for name, comment in walk(tomlkit.parse(text), "") if comment}


def field_names(design: Design) -> set[str]:
    """Return the dotted names of all numbers and choices that the page shows of a design."""
    return {*(name for name, _ in _numbers(design)), *_choices(design)}


def _numbers(design: Design) -> Iterator[tuple[str, FieldInfo]]:
    """Yield dotted name and field of each number that the page shows.

    Items of lists that the design leaves out, and a holder or mask that it has not, are skipped.
    """
    absent = [f"{table}." for table in ("holder", "mask") if getattr(design, table) is None]
    if design.holder is not None:  # keys of other kinds
        own = ("kind", *HOLDER_KEYS[design.holder.kind])
        absent += [f"holder.{key}" for key in Holder.model_fields if key not in own]
    of_shell = ("thickness_mm", "margin_mm")
    of_mask = {"shell": ("axis",), "plugs": OF_MASK, "block": of_shell, NO_MASK: ()}
    absent += [f"mask.{key}" for key in of_mask[mask_kind(design)]]
    hidden = (*NOT_SHOWN, *absent)
    for name, field in design.numeric_fields():
        in_list = name.rpartition(".")[2].isdecimal()
        if not name.startswith(hidden) and (not in_list or _value(design, name) is not None):
            yield name, field


def _choices(design: Design) -> dict[str, tuple[str, ...]]:
    """Return the allowed texts of each key that is a choice, by its dotted name.

    The chamber's shape is left out, because each shape has other keys.
    """
    tables = {"chamber": design.chamber, "sonotrode": design.sonotrode}
    found = (one for name, table in tables.items() for one in text_choices(table, name))
    return {name: texts for name, texts in found if name not in ("chamber.unit", "chamber.shape")}


def _value(design: Design, name: str) -> object:
    """Return the number of the design with this dotted name, or None if it is not set."""
    value: Any = design
    for step in name.split("."):
        if isinstance(value, tuple | list):
            value = value[int(step)]
        else:
            value = value.get(step) if isinstance(value, dict) else getattr(value, step, None)
    return value


def _bounds(field: FieldInfo) -> dict[str, float]:
    """Return the least and the largest allowed value of a field, if it has such bounds."""
    found: dict[str, float] = {}
    for constraint in field.metadata:
        for key, name in (("ge", "least"), ("le", "most")):
            if (value := getattr(constraint, key, None)) is not None:
                found[name] = float(value)
    return found
