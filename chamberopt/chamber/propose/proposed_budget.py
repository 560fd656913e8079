"""Propose how long to simulate, and in which windows, so that a first run resolves single places.

    n, N    balls per volume [1/m³], number of balls
    V       peak speed of the sonotrode [m/s]
    r       impacts on the target per area and time [1/(m² s)], estimated as IMPACTS n V
    g       gauge, the area of a window [m²]
    l       mean path of a ball: 1 / l = S / (4 Q) + 1 / (path from ball to ball), for the surface S
            and the volume Q of the cavity (Cauchy's mean chord 4 Q / S)

A window gets r g t dents in the time t. It is an estimate: a gas of balls whose mean speed is
SPEED V gives r = SPEED n V / 4, and places far from the sonotrode get less.

Source: the flux of an ideal gas on a wall, n v / 4, as in any textbook of kinetic theory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.dimensionless import free_path
from chamberopt.design.load import Design
from chamberopt.geometry.triangles import areas

REPLICAS = 8
DENTS = 33.0  # in a window: single places need 25 (coverage_intervals), and this is an estimate
SPEED = 0.3  # mean speed of the balls over the sonotrode's peak speed
FAR = 0.5  # of the impacts of an even gas, at the target's middle places
EVENTS = 2e7  # of all replicas: some minutes on two cores
LEAST_TIME, MOST_TIME = 0.5, 200.0  # s, of each replica
GAUGE = 1e-6  # m²: wider only where the time would be too long
WIDEST = 0.02  # of the target's area


class Budget(NamedTuple):
    """Simulated time of each replica, and the windows in which coverage is measured."""

    time: float  # [s]
    gauge_mm2: float
    time_reason: str
    gauge_reason: str


def propose_budget(design: Design, chamber: Chamber) -> Budget:
    """Return the budget with which single places of the target are probably resolved."""
    speed = SPEED * design.sonotrode.peak_speed
    density = design.shot.count / chamber.volume
    rate = FAR * density * speed / 4.0
    surface = float(areas(chamber.vertices, chamber.triangles).sum())
    per_path = surface / (4.0 * chamber.volume)
    per_path += 1.0 / (free_path(design, chamber) * chamber.height)
    events = design.shot.count * speed * per_path  # in a second
    wanted = DENTS / (REPLICAS * rate * GAUGE)
    time = _rounded_up(min(max(wanted, LEAST_TIME), max(EVENTS / (REPLICAS * events), LEAST_TIME)))
    time = min(time, MOST_TIME)
    dents = REPLICAS * rate * GAUGE * time
    target = float(chamber.part.area[chamber.part.target].sum())
    gauge = _rounded_up(max(1.0, min(DENTS / dents, WIDEST * target / GAUGE)))
    said = f"about {dents * gauge:.2g} dents in a window, by an estimate; 25 resolve single places"
    wider = (
        "WIDER than the usual 1 mm²: a window gets its dents within minutes" if gauge > 1 else ""
    )
    return Budget(time, gauge, said, wider)


def _rounded_up(value: float) -> float:
    """Return the next of 1, 2, 3, 5, 7 and their decimal multiples."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return float(
        f"{next(k for k in (1, 2, 3, 5, 7, 10) if k * power >= value * 0.999) * power:.3g}"
    )
