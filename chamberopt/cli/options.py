"""The application object, and the options that several commands share."""

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

app = App(
    name="chamberopt",
    help="Design ultrasonic shot peening chambers for uniform coverage of a part.",
    version=version("chamberopt"),
    suppress_keyboard_interrupt=False,
)

Json = Annotated[
    bool, Parameter(name="--json", negative="", help="Print JSON on stdout instead of text.")
]
Workers = Annotated[
    int | None,
    Parameter(
        name="--workers",
        help="Number of workers on this machine, by default one per core. Does not change results.",
    ),
]
Cluster = Annotated[
    str | None,
    Parameter(
        name="--cluster",
        help="Dask scheduler to use: tcp://HOST:PORT, or its scheduler file. "
        "Does not change results.",
    ),
]
Out = Annotated[
    Path | None, Parameter(name="--out", help="Folder for the results; it must be new or empty.")
]
Resumable = Annotated[
    Path | None,
    Parameter(
        name="--out", help="Folder for the results: new, empty, or that of this study to resume it."
    ),
]
View = Annotated[
    str | None,
    Parameter(help="Direction to the eye, X,Y,Z; by default one that shows what is drawn."),
]
