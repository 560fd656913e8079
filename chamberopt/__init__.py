"""Design of ultrasonic shot peening chambers. See chamberopt.api for use from Python."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from chamberopt.api import (
        Design,
        Result,
        Search,
        Study,
        calibrate,
        chart,
        compare,
        fields,
        impacts,
        load_design,
        load_result,
        load_study,
        measure_accuracy,
        optimise,
        peen_strip,
        plotter,
        propose,
        show,
        simulate,
        sweep,
        trials,
        view,
        with_part,
    )

__all__ = [
    "Design",
    "Result",
    "Search",
    "Study",
    "calibrate",
    "chart",
    "compare",
    "fields",
    "impacts",
    "load_design",
    "load_result",
    "load_study",
    "measure_accuracy",
    "optimise",
    "peen_strip",
    "plotter",
    "propose",
    "show",
    "simulate",
    "sweep",
    "trials",
    "view",
    "with_part",
]


def __getattr__(name: str) -> object:
    """Import a name of chamberopt.api when it is first used: `chamberopt --help` needs none."""
    if name in __all__:
        return getattr(import_module("chamberopt.api"), name)
    raise AttributeError(f"module 'chamberopt' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List these names at a Python prompt too."""
    return sorted({*globals(), *__all__})
