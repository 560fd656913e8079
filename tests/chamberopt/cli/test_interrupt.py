"""Ctrl-C at any moment of any command ends it, from the first line of the program that runs."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import SerialExecutor
from chamberopt.documents.answer import stopped_text
from chamberopt.results.load import load_result
from chamberopt.simulation.evaluate import evaluate
from tests.hunt.base import write_base

ROOT = Path(__file__).parents[3]
# A line is written when `main` has its handler; no command ends within the second that follows.
# (A busy machine took longer than 20 ms from a line before `main` to the handler.)
BEGIN = """
import signal, sys
from chamberopt.cli import main

handle = signal.signal

def handle_and_tell(*given):
    before = handle(*given)
    signal.signal = handle
    print(flush=True)
    return before

signal.signal = handle_and_tell
sys.exit(main())
"""
COMMANDS = {
    "check": ["design.toml"],
    "simulate": ["design.toml", "--out", "out"],
    "run": ["study.toml", "--out", "out"],
    "sweep": ["study.toml", "--grid", "2", "--out", "out"],
    "accuracy": ["design.toml", "--out", "out"],
    "compare": ["design.toml", "design-2.toml", "--out", "out"],
}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("interrupt")
    write_base(folder)
    shutil.copy(folder / "design.toml", folder / "design-2.toml")
    return folder


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("seconds", [0.02, 0.1, 0.3, 0.6])
@pytest.mark.parametrize("name", COMMANDS)
def test_ctrl_c_is_never_lost(name: str, seconds: float, place: Path) -> None:
    going = subprocess.Popen(
        [sys.executable, "-c", BEGIN, name, *COMMANDS[name]],
        cwd=place,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert going.stdout is not None
    assert going.stdout.readline() == "\n"
    time.sleep(seconds)
    going.send_signal(signal.SIGINT)
    begin = time.monotonic()
    _, message = going.communicate(timeout=60)
    assert going.returncode == 130, message
    assert time.monotonic() - begin < 5.0
    assert "Traceback" not in message
    assert "interrupted" in message
    shutil.rmtree(place / "out", ignore_errors=True)


def test_ctrl_c_after_the_command_changes_nothing(place: Path) -> None:
    """The process has its exit status; only its threads are still to be joined."""
    late = "status = main(); os.kill(os.getpid(), signal.SIGINT); sys.exit(status)"
    done = subprocess.run(
        [sys.executable, "-c", f"import os, signal, sys; from chamberopt.cli import main; {late}",
         "materials"],
        cwd=place,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_ctrl_c_keeps_the_replicas_that_have_ended(place: Path) -> None:
    """Simulated again with as many replicas, the design has the same figures."""
    design = (place / "design.toml").read_text()
    (place / "long.toml").write_text(re.sub(r"(?m)^replicas *=.*", "replicas = 999", design))
    going = subprocess.Popen(
        [sys.executable, "-m", "chamberopt", "simulate", "long.toml", "--out", "stopped",
         "--workers", "2", "--progress", "jsonl"],
        cwd=place,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert going.stderr is not None
    steps = (json.loads(line) for line in going.stderr if line.startswith('{"step"'))
    next(one for one in steps if one.get("total") == 999 and one["done"] >= 3)
    going.send_signal(signal.SIGINT)
    told, message = going.communicate(timeout=60)
    assert going.returncode == 130, message
    result = load_result(place / "stopped")
    replicas = result.record.replicas
    assert 3 <= replicas < 999
    assert result.record.stopped_by == "user"
    assert f"stopped by the user after {replicas} of 999 replicas" in result.record.notes[0]
    assert "98 %" in told
    assert stopped_text(result).startswith(f"Stopped after {replicas} of 999 replicas: ")
    again = result.design.changed({"process.accuracy.replicas": replicas})
    figures = evaluate(again, build_chamber(again), SerialExecutor()).metrics
    name = "mean_coverage"
    assert figures[name].value == result.record.metrics[name].value
