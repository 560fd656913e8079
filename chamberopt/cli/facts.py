"""Lines with the facts of a design or study that was checked, in words or by their names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.number_text import counted, plain
from chamberopt.documents.proposal import INDENT, wrapped

if TYPE_CHECKING:
    from chamberopt.design.design import Design

DIGITS = 4
MOST_NAMES = 20  # of a part's groups
UNITS = {"mm": "mm", "mm2": "mm²", "cm3": "cm³", "um": "µm", "m_s": "m/s", "s": "s"}
BESIDE = ("notes", "warnings", "effects", "folder")  # told beside the facts


def facts_lines(design: Design, facts: Mapping[str, Any]) -> list[str]:
    """Return lines with facts of chamber.checks.check, a subject each, in at most 79 columns.

    Args:
        facts: those of `describe`, or of `first_facts`, which lack what the shot reaches.
    """
    lines, before = [], ""
    for name, text in (*_main_rows(design, facts), *_other_rows(facts)):
        lines += wrapped(f"{'' if name == before else name:{INDENT - 1}} {text}", INDENT)
        before = name
    return lines


def _main_rows(design: Design, facts: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield name and text of each subject that every design has."""
    part, target, chamber, shot = (facts[x] for x in ("part", "target", "chamber", "shot"))
    box = " x ".join(plain(side, DIGITS) for side in part["bounding_box_mm"])
    names = [*part["names"][:MOST_NAMES], *["..."] * (len(part["names"]) > MOST_NAMES)]
    text = f"{Path(part['mesh']).name}, {box} mm as it stands, {_number(part, 'area_mm2')} mm²"
    yield "part", f"{text}{', with ' * bool(names)}{', '.join(names)}"
    text, inside = f"{_number(target, 'area_mm2')} mm²", target["exposed_area_mm2"]
    if inside < (1.0 - 1e-4) * target["area_mm2"]:
        text += f", {plain(inside, DIGITS)} mm² of it in the chamber"
    yield "target", text
    free = _number(chamber, "free_volume_cm3")
    yield "chamber", f"{chamber['shape']}, {free} cm³ without the part"
    motion = facts["sonotrode"]
    text = f"{_number(motion, 'amplitude_um')} µm zero-to-peak, "
    text += f"{_number(motion, 'amplitude_pv_um')} µm peak to valley, "
    yield "sonotrode", f"{text}{_number(motion, 'peak_speed_m_s')} m/s at most"
    diameters = sorted(set(design.shot.diameters))
    sizes = " and ".join(f"{plain(1e3 * one, DIGITS)} mm" for one in diameters)
    filled = f"{100.0 * shot['packing_fraction']:.2g} % of the chamber"
    balls = counted(shot["balls"], "ball")
    yield "shot", f"{balls} of {sizes}, {_number(shot, 'mass_g')} g, {filled}"
    if "sonotrode_clearance_mm" in chamber:
        gap = _number(chamber, "sonotrode_clearance_mm")
        yield "clearance", f"{gap} mm between sonotrode and part"
    if "reach" in facts:
        reach = facts["reach"]
        share = f"{100.0 * reach['target_reachable_share']:.3g} % of the target"
        yield "reach", f"balls of {_number(reach, 'ball_mm')} mm can touch {share}"
    if "replicas" in facts:
        count = counted(facts["replicas"]["count"], "replica")
        yield "simulated", f"{count} of {_number(facts['replicas'], 'recorded_s')} s"
    for name, text in facts.get("materials", {}).items():
        yield "materials", f"{name}: {text}"


def _other_rows(facts: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield name and text of each subject that only some designs have, such as zones."""
    main = ("part", "target", "chamber", "sonotrode", "shot", "materials", "reach", "replicas")
    for name, values in facts.items():
        if name in (*main, *BESIDE):
            continue
        if not isinstance(values, Mapping):
            yield name, str(values)
            continue
        if name in ("steps", "vary", "tolerances"):
            for inner, one in values.items():
                yield name, f"{inner}: {_range(one) or _in_words(one)}"
        elif values:
            yield name.replace("_", " "), _in_words(values)


def _range(values: Mapping[str, Any]) -> str:
    """Return what varies between a lowest and a highest value, as text; "" for other facts."""
    if "values" in values:
        return f"{values['start']}, one of {', '.join(values['values'])}"
    if set(values) != {"low", "start", "high"}:
        return ""
    low, start, high = (
        one if isinstance(one, str) else f"{one:g}"
        for one in (values["low"], values["start"], values["high"])
    )
    return f"{start}, from {low} to {high}"


def _in_words(values: Mapping[str, Any]) -> str:
    """Return facts as text, as "area 1150 mm², reachable share 1"; counts of triangles are no use.

    Lists of lengths along x, y and z stand as they are.
    """
    texts = []
    for key, value in values.items():
        if key.endswith("triangles") or value == []:
            continue
        ends = [end for end in UNITS if key.endswith(f"_{end}")]
        end = max(ends, key=len, default="")
        name = key.removesuffix(f"_{end}").replace("_", " ")
        every = value if isinstance(value, list) else [value]
        text = ", ".join(plain(x, DIGITS) if isinstance(x, float) else str(x) for x in every)
        texts.append(f"{name} {text} {UNITS.get(end, '')}".rstrip())
    return "; ".join(texts)


def _number(values: Mapping[str, Any], key: str) -> str:
    return plain(float(values[key]), DIGITS)


def table_lines(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Return a nested table as lines of text in aligned columns.

    A note or warning in the table is a line of its own.
    """
    lines: list[str] = []
    for name, value in table.items():
        label = f"{prefix + name:33} "
        if isinstance(value, Mapping) and set(value) == {"low", "start", "high"}:
            start = value["start"]  # a text if the design has none
            shown = start if isinstance(start, str) else f"{start:g}"
            lines.append(f"{label}{shown} in {value['low']:g} .. {value['high']:g}")
        elif isinstance(value, Mapping):
            lines += table_lines(value, f"{prefix}{name}.")
        elif name in ("notes", "warnings"):
            lines += [f"{name.removesuffix('s')}: {text}" for text in value]
        else:
            text = _list_text(value, name) if isinstance(value, list) else f"{value}"
            lines.append(label + text)
    return lines


def _list_text(values: list[Any], name: str) -> str:
    """Return a list as text. Sizes are written "1 x 2 x 3", other values with commas between."""
    if values and isinstance(values[0], float):
        separator = " x " if name.startswith("bounding_box") else ", "
        return separator.join(f"{value:g}" for value in values)
    return ", ".join(values) or "none"
