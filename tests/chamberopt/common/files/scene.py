"""A tiny scene on which all commands work, and the process that its commands are forked from."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

from chamberopt.cli import main
from chamberopt.output.viewer import subprocess_drawing
from tests.hunt.base import DESIGN, write_base

TINY = {
    "simulated_time_s": "0.02",
    "warmup_time_s": "0.001",
    "replicas": "3",
    "mass_g": "0.5",
}


def write_scene(folder: Path) -> None:
    """Write box.stl, design.toml and study.toml, with which every command takes a moment."""
    write_base(folder)
    for name in ("design.toml", "study.toml"):
        text = (folder / name).read_text()
        for key, value in TINY.items():
            text = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        text = text.replace('"shot.mass_g" = [2, 4]', '"shot.mass_g" = [0.4, 0.6]')
        (folder / name).write_text(text)


def warm_up() -> None:
    """Compile, and draw nothing with VTK, which takes seconds and a process of its own."""
    subprocess_drawing.missing_opengl = lambda: "pictures are left out"
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        write_scene(Path(folder))
        for words in ("simulate design.toml --out r", "run study.toml --out s"):
            assert main([*words.split(), "--workers", "1"]) == 0
        os.chdir(here)
