"""Sentences on a design that was checked: each fact once, under its subject."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from chamberopt.common.key_words import KINDS, in_words, unit_of
from chamberopt.common.number_text import counted, plain
from chamberopt.documents.proposal import INDENT, wrapped

if TYPE_CHECKING:
    from chamberopt.design.design import Design

DIGITS = 4
MOST_NAMES = 20  # of a part's groups
BESIDE = ("notes", "warnings", "effects", "folder")  # told beside the facts
MAIN = ("part", "target", "chamber", "sonotrode", "shot", "materials", "reach", "replicas")


class Fact(NamedTuple):
    """A fact of a design in words, and the subject under which it is told.

    Attributes:
        own_line: whether it begins a line of a terminal, as one of several things of its subject.
    """

    subject: str
    text: str
    own_line: bool = False


def facts_in_words(design: Design, facts: Mapping[str, Any]) -> list[Fact]:
    """Return facts of chamber.checks.facts in words, those of a subject one after the other.

    Args:
        facts: those of `describe`, or of `first_facts`, which lack what the shot reaches.
    """
    return [*_main_facts(design, facts), *_other_facts(facts)]


def facts_lines(design: Design, facts: Mapping[str, Any]) -> list[str]:
    """Return facts in lines of at most 79 columns, each subject in a paragraph."""
    lines = []
    for subject, told in groupby(facts_in_words(design, facts), lambda one: one.subject):
        paragraphs: list[str] = []
        for one in told:
            if one.own_line or not paragraphs:
                paragraphs.append(one.text)
            else:
                paragraphs[-1] += f", {one.text}"
        for k, text in enumerate(paragraphs):
            lines += wrapped(f"{'' if k else subject:{INDENT - 1}} {text}", INDENT)
    return lines


def range_text(values: Mapping[str, Any]) -> str:
    """Return what varies between a lowest and a highest value, as text; "" for other facts.

    A number that the design has not is given by a text.
    """
    if "values" in values:
        return f"{values['start']}, one of {', '.join(values['values'])}"
    if set(values) != {"low", "start", "high"}:
        return ""
    low, start, high = (
        one if isinstance(one, str) else f"{one:g}"
        for one in (values["low"], values["start"], values["high"])
    )
    return f"{start}, from {low} to {high}"


def _main_facts(design: Design, facts: Mapping[str, Any]) -> Iterator[Fact]:
    """Yield the facts that every design has."""
    part, target, chamber, shot = (facts[x] for x in ("part", "target", "chamber", "shot"))
    yield Fact("part", Path(part["mesh"]).name)
    box = " x ".join(plain(side, DIGITS) for side in part["bounding_box_mm"])
    yield Fact("part", f"{box} mm as it stands")
    yield Fact("part", _quantity(part, "area_mm2"))
    if names := part["names"]:
        more = ["..."] * (len(names) > MOST_NAMES)
        yield Fact("part", f"with {', '.join([*names[:MOST_NAMES], *more])}")
    yield Fact("target", _quantity(target, "area_mm2"))
    if target["exposed_area_mm2"] < (1.0 - 1e-4) * target["area_mm2"]:
        yield Fact("target", f"{_quantity(target, 'exposed_area_mm2')} of it in the chamber")
    yield Fact("chamber", chamber["shape"])
    yield Fact("chamber", f"{_quantity(chamber, 'free_volume_cm3')} without the part")
    motion = facts["sonotrode"]
    yield Fact("sonotrode", f"{_quantity(motion, 'amplitude_um')} zero-to-peak")
    yield Fact("sonotrode", f"{_quantity(motion, 'amplitude_pv_um')} peak to valley")
    yield Fact("sonotrode", f"{_quantity(motion, 'peak_speed_m_s')} at most")
    diameters = sorted(set(design.shot.diameters))
    sizes = " and ".join(f"{plain(1e3 * one, DIGITS)} mm" for one in diameters)
    yield Fact("shot", f"{counted(shot['balls'], 'ball')} of {sizes}")
    yield Fact("shot", _quantity(shot, "mass_g"))
    yield Fact("shot", f"{100.0 * shot['packing_fraction']:.2g} % of the chamber")
    if "sonotrode_clearance_mm" in chamber:
        gap = _quantity(chamber, "sonotrode_clearance_mm")
        yield Fact("clearance", f"{gap} between sonotrode and part in the chamber")
    if "reach" in facts:
        reach = facts["reach"]
        share = f"{100.0 * reach['target_reachable_share']:.3g} % of the target"
        yield Fact("reach", f"balls of {_quantity(reach, 'ball_mm')} can touch {share}")
    if "replicas" in facts:
        least, most = (facts["replicas"][key] for key in ("count", "most"))
        count = counted(most, "replica") if most == least else f"{least} to {most} replicas"
        yield Fact("simulated", f"{count} of {_quantity(facts['replicas'], 'recorded_s')}")
    for name, text in facts.get("materials", {}).items():
        yield Fact("materials", f"{name}: {text}", own_line=True)


def _other_facts(facts: Mapping[str, Any]) -> Iterator[Fact]:
    """Yield the facts of subjects that only some designs have, such as zones."""
    for name, values in facts.items():
        if name in (*MAIN, *BESIDE):
            continue
        if not isinstance(values, Mapping):
            yield Fact(name, str(values))
        elif name == "steps":
            for inner, one in values.items():
                yield from (Fact(f"step {inner}", text) for text in _texts(one))
        elif name in ("vary", "tolerances"):
            for inner, one in values.items():
                yield Fact(name, f"{inner}: {range_text(one)}", own_line=True)
        else:
            yield from (Fact(name.replace("_", " "), text) for text in _texts(values))


def _texts(values: Mapping[str, Any]) -> Iterator[str]:
    """Yield a text for each fact, such as "area 1150 mm²"; counts of triangles are no use."""
    for key, value in values.items():
        if key.endswith("triangles") or value == []:
            continue
        if key == "kind":
            yield KINDS.get(value, value)
            continue
        unit = unit_of(key)
        factor = 100.0 if unit == "%" else 1.0
        every = value if isinstance(value, list) else [value]
        texts = [plain(factor * x, DIGITS) if isinstance(x, float) else str(x) for x in every]
        text = f"({', '.join(texts)})" if len(texts) > 1 else texts[0]
        yield f"{in_words(key)} {text} {unit}".rstrip()


def _quantity(values: Mapping[str, Any], key: str) -> str:
    return f"{plain(float(values[key]), DIGITS)} {unit_of(key)}"
