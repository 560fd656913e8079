"""The commands, one file each; importing one registers it with the application."""

from chamberopt.cli.commands import (
    accuracy,
    check,
    compare,
    dents,
    export,
    inspect,
    replay,
    report,
    run,
    simulate,
    sweep,
)

__all__ = [
    "accuracy",
    "check",
    "compare",
    "dents",
    "export",
    "inspect",
    "replay",
    "report",
    "run",
    "simulate",
    "sweep",
]
