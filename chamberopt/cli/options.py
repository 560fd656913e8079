"""Define the application object, and the options that several commands share."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, get_args

from cyclopts import App, CoercionError, Parameter, Token, convert


def _convert(kind: object, tokens: Sequence[Token]) -> object:
    """Return the value of an option, converted from its text.

    Raises CoercionError if a whole number is wanted and 1.5 given, which cyclopts would round.
    """
    if int in (kind, *get_args(kind)):
        for token in tokens:
            if "." in token.value and token.value.rpartition(".")[2].strip("0"):
                raise CoercionError(token=token, target_type=int)
    return convert(kind, tokens)


app = App(
    name="chamberopt",
    help="Design ultrasonic shot peening chambers for uniform coverage of a part. Every command "
    "takes --progress jsonl, which tells its steps to other programs.",
    version=version("chamberopt"),
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(converter=_convert),
)

Json = Annotated[
    bool, Parameter(name="--json", negative="", help="Print JSON on stdout instead of text.")
]
_VERBOSE = "Also print every figure by its name in files, and all notes."
Verbose = Annotated[bool, Parameter(name=("--verbose", "-v"), negative="", help=_VERBOSE)]
_WORKERS = "Number of workers on this machine, by default one per core. Does not change results."
Workers = Annotated[int | None, Parameter(name="--workers", help=_WORKERS)]
_CLUSTER = "Dask scheduler to use: tcp://HOST:PORT, or its scheduler file. Does not change results."
Cluster = Annotated[str | None, Parameter(name="--cluster", help=_CLUSTER)]
Out = Annotated[
    Path | None, Parameter(name="--out", help="Folder for the results; it must be new or empty.")
]
_RESUMABLE = "Folder for the results: new, empty, or that of this study to resume it."
Resumable = Annotated[Path | None, Parameter(name="--out", help=_RESUMABLE)]
_VIEW = "Direction to the eye, X,Y,Z; by default one that shows what is drawn."
View = Annotated[str | None, Parameter(help=_VIEW)]
_ACCURACY = "Half-width of the objective's interval to reach, in the place of the file's "
_ACCURACY += "process.accuracy.objective_half_width."
Accuracy = Annotated[float | None, Parameter(name="--accuracy", help=_ACCURACY)]
_TIME = "Treatment time, such as 90s, 10m or 1h30m, in the place of the file's."
TreatmentTime = Annotated[timedelta | None, Parameter(name="--time", help=_TIME)]


# The option that gives a value in the place of the file's, by the value's dotted name.
IN_PLACE_OF = {
    "process.accuracy.objective_half_width": "--accuracy",
    "process.treatment_time_s": "--time",
    "optimizer.evaluations": "--evaluations",
}


def given_values(
    accuracy: float | None, time: timedelta | None, evaluations: int | None = None
) -> dict[str, float]:
    """Return the values that options give in the place of the file's, by dotted name."""
    values = accuracy, None if time is None else time.total_seconds(), evaluations
    named = zip(IN_PLACE_OF, values, strict=True)
    return {name: value for name, value in named if value is not None}


def as_options(values: Mapping[str, float]) -> list[str]:
    """Return the options that give values in the place of the file's."""
    words: list[str] = []
    for name, value in values.items():
        option = IN_PLACE_OF[name]
        words += [option, f"{value:g}s" if option == "--time" else f"{value:g}"]
    return words
