"""The command `accuracy` from design to recommendation, without the simulator."""

import csv
import json
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.coverage.coverage_from_impacts import Footprints
from chamberopt.coverage.field.target_field import TargetField
from chamberopt.design.load import load_design, save_design
from chamberopt.simulation.numerical_parameters import (
    ELASTIC_SPEED,
    FACETS,
    GAUGE,
    MOTION,
    POINTS,
    TIME,
    WARM_UP,
)
from chamberopt.simulation.replicas import ReplicaSetting
from chamberopt.simulation.timed_replicas import TimedReplica
from tests.helpers.synthetic import plate_design

DENT = 2e-7  # m²


def footprints_of(
    field: TargetField, rng: np.random.Generator, seconds: float, rate: float
) -> Footprints:
    """Dents in windows on their own, a quarter more per second in later ones."""
    gauge = field.gauge
    slant = np.linspace(0.8, 1.2, len(gauge.area))
    point = np.repeat(np.arange(len(slant)), rng.poisson(rate * seconds * slant))
    weight = field.alike * DENT / gauge.area[point]
    return Footprints(point, weight, DENT * len(point), 0.0, DENT**2 * len(point))


def made_up_replica(setting: ReplicaSetting, target: TargetField, number: int) -> TimedReplica:
    """Random dents; fewer facets give fewer."""
    design = setting.design
    seconds = design.process.recorded_time
    rng = np.random.default_rng([number, round(1e6 * seconds)])
    rate = 2.0 * (0.9 if design.chamber.facets == 16 else 1.0)
    cpu = 0.002 + 0.01 * (seconds + design.process.accuracy.warmup_time)
    return TimedReplica(footprints_of(target, rng, seconds, rate), cpu)


@pytest.fixture
def no_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chamberopt.simulation.convergence.simulate_timed", made_up_replica)
    monkeypatch.setattr(
        "chamberopt.simulation.convergence.timed_evaluation", lambda *_: (0.5, 0.4, 0.1)
    )
    still = SimpleNamespace(thread_time=lambda: 0.0, perf_counter=lambda: 0.0)
    for module in ("convergence", "timed_replicas"):
        monkeypatch.setattr(f"chamberopt.simulation.{module}.time", still)
    monkeypatch.setattr("chamberopt.cli.teller.compile_with_message", lambda *_: None)


def accuracy(folder: Path, budget: str, *options: str) -> int:
    design = folder.with_name("design.toml")
    save_design(plate_design(process__accuracy__points=2_000), design)
    return main(["accuracy", str(design), "--out", str(folder), f"--budget-s={budget}", *options])


@pytest.mark.usefixtures("no_simulator")
def test_command_leaves_table_picture_and_lines_to_paste(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = accuracy(tmp_path / "out", "14", "--json")
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
        GAUGE,
        POINTS,
        "reference",
        "replicas",
    }
    settings = {(row["parameter"], row["setting"]): row for row in printed["rows"]}
    coarse = settings[FACETS, "16"]  # the bias of a tenth fewer dents is significant
    assert coarse["bias_mean_coverage"] < -coarse["bias_mean_coverage_half_width"] < 0
    assert 9.0 <= printed["cpu_s"] <= 10.2  # 4 of the 14 are for start and picture
    assert printed["left_out"] == []
    design = load_design(folder / "design.toml")
    *reachable, too_much = printed["recommendations"]
    assert any("raise process.accuracy.points" in one for one in too_much["remarks"])
    for advice in reachable:
        pasted = tomllib.loads("\n".join(advice["lines"]))["process"]["accuracy"]
        assert design.changed({f"process.accuracy.{name}": value for name, value in pasted.items()})


@pytest.mark.usefixtures("no_simulator")
def test_command_prints_its_findings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert accuracy(tmp_path / "out", "14", "--verbose") == 0
    out = capsys.readouterr().out
    for words in (
        "± 0.01 of the uniform coverage takes about ",
        "reference: ",
        "compared with the finest",
        "halving the error cost",
        "CPU s a replica",
    ):
        assert words in out
    assert out.count("[process.accuracy]") == 2


@pytest.mark.usefixtures("no_simulator")
def test_a_small_budget_leaves_settings_out_or_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert accuracy(tmp_path / "out", "9", "--json") == 0
    found = capsys.readouterr()
    printed = json.loads(found.out)
    assert printed["left_out"][0] == GAUGE  # the first in the order
    assert WARM_UP not in printed["left_out"]
    assert "left out by --budget-s = 9: gauge" in found.err
    assert GAUGE not in {row["parameter"] for row in printed["rows"]}
    assert accuracy(tmp_path / "small", "5", "--json") == 2
    err = capsys.readouterr().err
    assert "--budget-s: given 5, but 32 replicas of the reference" in err
    assert re.search(r"give at least \d+", err)


@pytest.mark.usefixtures("no_simulator")
def test_without_dents_there_is_no_error_to_measure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    def no_dents(setting: ReplicaSetting, target: TargetField, number: int) -> TimedReplica:
        return TimedReplica(footprints_of(target, np.random.default_rng(1), 1.0, 0.0), 0.01)

    monkeypatch.setattr("chamberopt.simulation.convergence.simulate_timed", no_dents)
    assert accuracy(tmp_path / "out", "14") == 2
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
