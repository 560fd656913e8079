"""Write numbers as text, and give each metric and objective a name and a unit."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from chamberopt.common import number_text
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.key_words import KEY, inner_first, key_in_words, unit_of
from chamberopt.common.number_text import estimate_text
from chamberopt.coverage.metrics import (
    OBJECTIVES,
    find_metric,
    highest_objective,
    is_number,
    parse_objective,
)
from chamberopt.documents.document import Table
from chamberopt.geometry.meshes.formats import SUFFIXES

if TYPE_CHECKING:
    from chamberopt.results.impact_energy import ImpactEnergy

FILES = (".toml", ".json", ".html", ".pdf", ".png", *SUFFIXES)  # "part.stl" is no key
_KEY = re.compile(KEY)


@dataclass(frozen=True)
class Label:
    """The name, unit and scale by which texts show a metric or an objective.

    Args:
        text: name in plain words.
        unit: unit of the number shown.
        factor: shown number divided by stored number, e.g. 100 for per cent. Negative if the
            objective is a negative multiple of a metric.
        meaning: explanation, if the text needs any.
        most: largest number that can be shown, such as 100 for per cent.
    """

    text: str
    unit: str = ""
    factor: float = 1.0
    meaning: str = ""
    most: float = math.inf

    @property
    def in_full(self) -> str:
        """The name with its meaning, e.g. "weighted sum (mean coverage − 0.001 × ...)"."""
        return f"{self.text} ({self.meaning})" if self.meaning else self.text

    @property
    def with_unit(self) -> str:
        """The name with its unit, e.g. "mean coverage [%]"."""
        return f"{self.text} [{self.unit}]" if self.unit else self.text

    def format(self, estimate: Estimate, sign: bool = False) -> str:
        """Return an estimate as text with its interval and its unit, e.g. "98.1 ± 0.4 %"."""
        return number_text.typeset(
            number_text.estimate_text(estimate, self.factor, self.unit, sign)
        )

    def number(self, estimate: Estimate, sign: bool = False) -> str:
        """Return an estimate as text with its interval, without the name of its unit."""
        return number_text.typeset(number_text.estimate_text(estimate, self.factor, sign=sign))

    def scale(self, estimate: Estimate) -> Estimate:
        """Convert an estimate from its stored unit to the unit of this label."""
        value, half_width = self.factor * estimate.value, abs(self.factor) * estimate.half_width
        return Estimate(value, half_width, in_words=estimate.in_words)


def metric_label(name: str) -> Label:
    """Return the label of the metric `name`. Shares of the surface are shown in per cent."""
    metric = find_metric(name)
    if metric is None:
        return Label(name if is_number(name) else name.replace("_", " "))
    if name.endswith("_coverage"):
        return Label(metric.summary, "%", 100.0, most=100.0)
    return Label(metric.summary, "" if metric.unit == "balls" else metric.unit)  # "number of balls"


def objective_label(name: str) -> Label:
    """Return the label of the objective `name`.

    If the objective is a multiple of a single metric, its label has the metric's text and unit.
    """
    try:
        objective = parse_objective(name)
    except InputError:  # written by another version of the program
        return Label(name.replace("_", " "))
    (metric, weight), *others = objective.terms.items()
    if not others and weight:
        label = metric_label(metric)
        return replace(label, factor=label.factor / weight)
    most = highest_objective(name, 1.0)
    if name in OBJECTIVES:
        return Label(name.replace("_", " "), meaning=objective.summary, most=most)
    return Label("weighted sum", meaning=_sum_text(objective.terms), most=most)


def _sum_text(terms: Mapping[str, float]) -> str:
    """Return a weighted sum of metrics as text.

    An example is "mean coverage of the target − 0.001 × number of balls".
    """
    text = ""
    for name, weight in terms.items():
        metric = find_metric(name)
        words = metric.summary if metric else name
        if metric and metric.unit not in ("", "balls"):
            words += f" [{metric.unit}]"
        words = f"({words})" if " - " in words else words
        size = "" if abs(weight) == 1.0 else f"{plain(abs(weight))} × "
        sign = "−" if weight < 0.0 else "+" if text else ""
        text += f" {sign} {size}{words}" if sign else f"{size}{words}"
    return text.strip()


def plain(value: float | str, digits: int = 4) -> str:
    """Return a number as text with `digits` significant digits.

    Only very large and very small numbers have an exponent.
    """
    return number_text.typeset_plain(value, digits)


def value_text(value: object, digits: int = 4) -> str:
    """Return a value of a file as text: yes or no, numbers and words, joined by commas.

    >>> value_text([True, 20.5, ["all"]])
    'yes, 20.5, (all)'
    """
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return plain(value, digits)
    if isinstance(value, list | tuple):
        texts = [(one, value_text(one, digits)) for one in value]
        return ", ".join(
            f"({text})" if isinstance(one, list | tuple) else text for one, text in texts
        )
    return json.dumps(value, ensure_ascii=False) if isinstance(value, dict) else str(value)


def named_value(name: str, value: object, digits: int = 4) -> str:
    """Return a number of a design and its value in words, with its unit.

    >>> named_value("shot.mass_g", 3.6)
    'mass of the shot 3.6 g'
    """
    return f"{inner_first(name)} {value_text(value, digits)} {unit_of(name)}".rstrip()


def with_unit(value: float, unit: str = "") -> str:
    """Return a number as text with two significant digits and its unit."""
    return f"{plain(value, 2)} {unit}".rstrip()


def with_interval(value: float, half_width: float, unit: str = "", sign: bool = False) -> str:
    """Return a value and its interval as text, e.g. "0.809 ± 0.004 mm".

    An exact value is shown without an interval.
    """
    return number_text.typeset(number_text.with_interval(value, half_width, unit, sign))


def per_cent(value: float) -> str:
    """Return a share from 0 to 1 as text in whole per cent."""
    return f"{100.0 * value:.0f} %"


def per_cent_closely(value: float) -> str:
    """Return a share from 0 to 1 as text in per cent with one decimal, such as "1.4 %"."""
    return f"{plain(round(100.0 * value, 1))} %"


def keys_in_words(text: str) -> str:
    """Return a text with words in the place of keys of files, for readers who edit no file.

    >>> keys_in_words("raise process.accuracy.simulated_time_s of part.stl")
    'raise simulated time of the accuracy of the process of part.stl'
    """
    return _KEY.sub(
        lambda found: found[0] if found[0].lower().endswith(FILES) else key_in_words(found[0]), text
    )


def energy_lines(found: ImpactEnergy) -> list[Table | str]:
    """Return what the command `energy` prints: a row for each surface, and their sum."""
    total, head = found.lost, ("", "mm²", "impacts/s", "mW/cm²", "lost, mW", "share, %")
    rows = []
    for one in found.surfaces:
        over_area = 0.1 * one.impact_power.value / one.area
        rows.append((
            one.name,
            plain(1e6 * one.area, 3) if math.isfinite(one.area) else "",
            plain(one.rate.value, 3),
            plain(over_area, 3) if math.isfinite(over_area) else "",
            estimate_text(one.lost_power, 1e3),
            plain(100.0 * one.lost_power.value / total, 3) if total else "",
        ))  # fmt: skip
    rows.append(("all", "", "", "", plain(1e3 * total, 3), "100"))
    return [
        Table("", head, rows),
        "mW/cm²: energy of impacts over area. Lost: to normal rebounds, ± 95 % by tenths of "
        f"{plain(found.seconds)} s; what friction takes is not in it.",
    ]
