"""The command `accuracy` from design to recommendation, without the simulator."""

import csv
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.design.load import load_design
from chamberopt.simulation.convergence.parameters import (
    ELASTIC_SPEED,
    FACETS,
    MODEL,
    MOTION,
    TIME,
    WARM_UP,
)
from chamberopt.simulation.convergence.study import TimedReplica
from chamberopt.simulation.replicas import ReplicaSetting
from tests.helpers.synthetic import DESIGNS, equal_dents


def made_up_replica(setting: ReplicaSetting, number: int) -> TimedReplica:
    """Random dents, a quarter more per second on later triangles; fewer facets give fewer."""
    design, chamber, _, samples = setting
    seconds = design.process.recorded_time
    rng = np.random.default_rng([number, round(1e6 * seconds)])
    slant = np.linspace(0.8, 1.2, len(chamber.exposed_area)) * (
        0.9 if design.chamber.facets == 16 else 1.0
    )
    dents = rng.poisson(2e6 * seconds * chamber.exposed_area * slant)
    tally = equal_dents(seconds, dents, 2e-7)
    cpu = 0.002 + 0.01 * (seconds + design.process.accuracy.warmup_time)
    if samples is None:
        return TimedReplica(tally, None, cpu)
    share = -np.expm1(-tally.dented_area / np.maximum(chamber.exposed_area, 1e-12))
    return TimedReplica(tally, share, 2.0 * cpu)


@pytest.fixture
def no_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chamberopt.simulation.convergence.study.simulate_timed", made_up_replica)
    monkeypatch.setattr("chamberopt.cli.commands.accuracy.compile_with_message", lambda *_: None)


def accuracy(folder: Path, budget: str, *options: str) -> int:
    design = str(DESIGNS / "plate.toml")
    return main(["accuracy", design, "--out", str(folder), f"--budget-s={budget}", *options])


@pytest.mark.usefixtures("no_simulator")
def test_command_leaves_table_picture_and_lines_to_paste(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = accuracy(tmp_path / "out", "2", "--json")
    printed = json.loads(capsys.readouterr().out)
    assert status == 0
    folder = Path(printed["folder"])
    assert {path.name for path in folder.iterdir()} == {
        "accuracy.json",
        "accuracy.csv",
        "accuracy.png",
        "design.toml",
    }
    assert (folder / "accuracy.png").stat().st_size > 20_000
    with (folder / "accuracy.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    written = json.loads((folder / "accuracy.json").read_text(encoding="utf-8"))
    assert written["rows"] == printed["rows"]
    assert {row["parameter"] for row in rows} >= {
        FACETS,
        MOTION,
        WARM_UP,
        ELASTIC_SPEED,
        TIME,
        MODEL,
        "reference",
        "replicas",
    }
    settings = {(row["parameter"], row["setting"]): row for row in printed["rows"]}
    coarse = settings[FACETS, "16"]  # the bias of a tenth fewer dents is significant
    assert coarse["bias_mean_coverage"] < -coarse["bias_mean_coverage_half_width"] < 0
    assert printed["cpu_s"] >= 1.5
    design = load_design(folder / "design.toml")
    for advice in printed["recommendations"]:
        pasted = tomllib.loads("\n".join(advice["lines"]))["process"]["accuracy"]
        assert design.changed({f"process.accuracy.{name}": value for name, value in pasted.items()})


@pytest.mark.usefixtures("no_simulator")
def test_command_prints_its_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert accuracy(tmp_path / "out", "0.01") == 0
    out = capsys.readouterr().out
    for words in (
        "reference: 33 replicas",
        "compared with the finest",
        "halving the error costs",
        "CPU s a replica",
    ):
        assert words in out
    assert out.count("[process.accuracy]") == 3


@pytest.mark.usefixtures("no_simulator")
def test_without_dents_there_is_no_error_to_measure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    def no_dents(setting: ReplicaSetting, number: int) -> TimedReplica:
        triangles = len(setting.chamber.exposed_area)
        share = None if setting.samples is None else np.zeros(triangles)
        return TimedReplica(equal_dents(1.0, np.zeros(triangles, int), 1e-7), share, 0.01)

    monkeypatch.setattr("chamberopt.simulation.convergence.study.simulate_timed", no_dents)
    assert accuracy(tmp_path / "out", "0.01") == 2
    assert "no dent on the target was simulated" in capsys.readouterr().err


@pytest.mark.parametrize("budget", ["0", "-1", "nan", "inf"])
def test_a_budget_that_is_not_positive_and_finite_is_refused(
    budget: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert accuracy(tmp_path / "out", budget) == 2
    err = capsys.readouterr().err
    assert "--budget-s: given" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()
