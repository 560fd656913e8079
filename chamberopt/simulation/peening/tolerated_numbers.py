"""The numbers of a design that have tolerances: their ranges, and how far each is moved in its run.

Notation
    x    a number with a tolerance; any value from low to high is as likely (ToleratedNumber)
    u    ln(x / nominal) where the number is positive, x - nominal otherwise         (moved)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.peening.tolerances import require_tolerances, tolerance_box

if TYPE_CHECKING:
    from chamberopt.design.load import Design

# A change of five times the tolerance has a fifth of the noise, at the price of curvature. Beyond
# a third of the number, curvature would be the larger error (benchmarks/response_steps.py).
STRETCH, MOST = 5.0, 0.3
MASS = "shot.mass_g"
SAMPLE_EXPONENT = 12  # the box has 2^12 points


@dataclass(frozen=True)
class ToleratedNumber:
    """A number of a design with its range, in the unit of the file, and the run that moves it."""

    name: str
    low: float
    nominal: float
    high: float
    changed: Design  # with this number alone changed
    step: float  # u of that change, of what is really there

    def moved(self, value: float) -> float:
        """u of a value."""
        return _moved(self.nominal, self.low, value)


def plan_tolerances(design: Design) -> tuple[ToleratedNumber, ...]:
    """The numbers of a design that have tolerances, each with the change that is simulated.

    InputError if there are none, or the design cannot have one end of a range.
    """
    box = tolerance_box(design)
    if not box:
        remedy = 'add a table [tolerances], such as "shot.mass_g" = "2 %"'
        raise InputError(f"tolerances: the design has none; {remedy}")
    require_tolerances(design)
    return tuple(_planned(design, name, *ends) for name, ends in box.items())


def effective_move(design: Design, number: ToleratedNumber) -> float:
    """u of a number in a design; of the shot's mass it is that of its whole balls."""
    if number.name != MASS:
        return number.moved(design.value(number.name))
    return number.moved(1e3 * design.shot.count * design.shot.ball_mass)


def box_points(numbers: tuple[ToleratedNumber, ...]) -> np.ndarray:
    """u at points spread evenly over the box, (n, k)."""
    from scipy.stats.qmc import Sobol

    sample = Sobol(len(numbers), seed=0).random_base2(SAMPLE_EXPONENT)
    columns = []
    for x, share in zip(numbers, sample.T, strict=True):
        values = x.low + share * (x.high - x.low)
        is_log = _is_logarithmic(x.nominal, x.low)
        columns.append(np.log(values / x.nominal) if is_log else values - x.nominal)
    return np.array(columns).T


def ball_notes(design: Design, numbers: tuple[ToleratedNumber, ...]) -> list[str]:
    """How many whole balls the range of the shot's mass is."""
    for one in numbers:
        if one.name == MASS:
            ends = ({MASS: end, "tolerances": None} for end in (one.low, one.high))
            few, many = (design.changed(end).shot.count for end in ends)
            return [
                f"{MASS} from {one.low:.4g} to {one.high:.4g} is {few} to {many} whole balls; its "
                "effects are those of the mass that is really there"
            ]
    return []


def _planned(design: Design, name: str, low: float, high: float) -> ToleratedNumber:
    """The change of one number: the widest allowed of those wanted, to the wider side if it can."""
    nominal = design.value(name)
    logarithmic = _is_logarithmic(nominal, low)
    sides = sorted((_moved(nominal, low, end) for end in (low, high)), key=abs)
    least = abs(sides[1])
    most = max(least, min(MOST, STRETCH * least)) if logarithmic else STRETCH * least
    if name == MASS:  # by one ball at least
        most = max(most, 1.0 / design.shot.count)
    sizes = (most, 0.5 * most, 0.25 * most, least)
    for size in (one for one in sizes if one >= least):
        for sign in (math.copysign(1.0, sides[1]), -math.copysign(1.0, sides[1])):
            value = nominal * math.exp(sign * size) if logarithmic else nominal + sign * size
            try:
                changed = design.changed({name: value, "tolerances": None})
            except InputError:
                continue
            number = ToleratedNumber(name, low, nominal, high, changed, sign * size)
            step = effective_move(changed, number) - effective_move(design, number)
            if step:
                return ToleratedNumber(name, low, nominal, high, changed, step)
    text = "no change of this number can be simulated; leave it out"
    raise InputError(f"tolerances.{name}: {text}")


def _moved(nominal: float, low: float, value: float) -> float:
    return math.log(value / nominal) if _is_logarithmic(nominal, low) else value - nominal


def _is_logarithmic(nominal: float, low: float) -> bool:
    """Whether u is a logarithm, see above."""
    return nominal > 0.0 and low > 0.0
