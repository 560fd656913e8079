"""A tiny scene on which all commands work, and the process that its commands are forked from."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from chamberopt.chamber import build
from chamberopt.chamber.checks import check
from chamberopt.cli import main
from chamberopt.common import executor
from chamberopt.common.files import write_bytes
from chamberopt.pictures import subprocess_drawing
from chamberopt.search.run_study import ChamberSimulator
from chamberopt.workflows import ranges, save_run, simulate
from tests.hunt.base import write_base

TINY = {"simulated_time_s": "0.02", "warmup_time_s": "0.001", "replicas": "3", "mass_g": "0.5"}
SIMULATE = "simulate design.toml --workers 1 --no-ranges --out result"
RUN = "run study.toml --workers 1 --out study"


def write_scene(folder: Path) -> None:
    """Write box.stl, design.toml and study.toml, with which every command takes a moment."""
    write_base(folder)
    for name in ("design.toml", "study.toml"):
        text = (folder / name).read_text()
        for key, value in TINY.items():
            text = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        text = text.replace('"shot.mass_g" = [2, 4]', '"shot.mass_g" = [0.4, 0.6]')
        (folder / name).write_text(text)


def compile_all() -> None:
    """Run commands once. Pictures of VTK, which draws in a process of its own, are left out."""
    subprocess_drawing.missing_opengl = lambda: "pictures are left out"
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        write_scene(Path(folder))
        for words in (SIMULATE, RUN, "report result", "check design.toml"):
            assert main(words.split()) == 0
        os.chdir(here)


def remember_all() -> None:
    """Do what compile_all does, and compute nothing again that it has computed."""
    _remember(build, "build_chamber")
    _remember(save_run, "complete_result")
    _remember(simulate, "evaluate_until_stopped")
    _remember(ranges, "simulate_ends")
    _remember(ChamberSimulator, "__call__")
    os.fsync = lambda _: None  # the disk is slow, and no power cut is tested
    check.warnings = lambda *_: []
    save_run.convergence_picture = lambda path, *_: write_bytes(path, b"a picture")
    save_run.sweep_map = lambda path, *_: [write_bytes(path, b"a picture")][1:]
    # Worker processes would do all from the beginning.
    executor.local_executor = lambda *_: executor.ThreadExecutor(1)
    compile_all()


def _remember(place: Any, name: str) -> None:
    """Keep what a function returns, by the design that it is given and by its plain values.

    The function is replaced wherever it has been imported to.
    """
    function, known = getattr(place, name), {}

    def remembered(*given: Any, **named: Any) -> Any:
        key = tuple(
            one.model_dump_json(exclude={"part": {"mesh"}})
            if hasattr(one, "model_dump_json")
            else one
            for one in given
            if hasattr(one, "model_dump_json") or isinstance(one, (str, int))
        )
        if key not in known:
            known[key] = function(*given, **named)
        return known[key]

    for module in [place, *sys.modules.values()]:
        if vars(module).get(name) is function:
            setattr(module, name, remembered)
