"""The program's name, and the options that several commands have."""

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

app = App(
    name="chamberopt",
    help="Designs ultrasonic shot peening chambers for uniform coverage of a part.",
    version=version("chamberopt"),
    suppress_keyboard_interrupt=False,
)

Json = Annotated[
    bool, Parameter(name="--json", negative="", help="Print JSON on stdout instead of text.")
]
Workers = Annotated[
    int | None,
    Parameter(
        name="--workers", help="Workers on this machine; one per core if left out. Same figures."
    ),
]
Cluster = Annotated[
    str | None,
    Parameter(
        name="--cluster",
        help="Dask scheduler to work on: tcp://HOST:PORT, or its scheduler file. Same figures.",
    ),
]
Out = Annotated[Path | None, Parameter(name="--out", help="Folder for the results; new or empty.")]
Resumable = Annotated[
    Path | None,
    Parameter(
        name="--out",
        help="Folder for the results; new, empty, or of this study where it was stopped.",
    ),
]
