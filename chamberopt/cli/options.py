"""Define the application object, and the options that several commands share."""

from collections.abc import Sequence
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
