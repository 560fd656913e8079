"""What accuracy costs: errors, laws and fronts on noise whose truth is known; the command without a simulation."""

import csv
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate, student_quantile
from chamberopt.design.load import load_design
from chamberopt.simulation.convergence import study as climbing
from chamberopt.simulation.convergence.error_law import (
    Law,
    Level,
    fitted,
    front,
    law_of,
    rms_error,
    rms_interval,
)
from chamberopt.simulation.convergence.parameters import (
    FACETS,
    FLOOR,
    MOTION,
    PIECE,
    TIME,
    WARM_UP,
    designs,
    knobs,
)
from chamberopt.simulation.convergence.recommendation import (
    choices,
    cost,
    explained,
    recommend,
    replicas_for,
)
from chamberopt.simulation.convergence.runs import Run
from chamberopt.simulation.convergence.study import ConvergenceStudy
from tests.helpers.synthetic import DESIGNS, equal_dents, plate_design

# Errors and laws


def pools(draws: int, size: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Standard normal replicas: means of sub-pools (draws, size / count), and of whole pools (draws,)."""
    values = np.random.default_rng(1).normal(size=(draws, size))
    return values.reshape(draws, -1, count).mean(axis=2), values.mean(axis=1)


@pytest.mark.parametrize("count", [4, 16, 32])
def test_error_of_a_sub_pool_is_that_against_the_truth_not_against_its_own_pool(count: int) -> None:
    parts, whole = pools(4000, 64, count)
    square = np.mean(
        [rms_error(part, one, count / 64) ** 2 for part, one in zip(parts, whole, strict=True)]
    )
    assert square == pytest.approx(1.0 / count, rel=0.05)
    assert np.mean((parts - whole[:, None]) ** 2) == pytest.approx(
        (1 - count / 64) / count, rel=0.05
    )


def test_interval_of_an_error_holds_it_as_often_as_it_says() -> None:
    parts, whole = pools(2000, 64, 8)
    ends = [
        rms_interval(rms_error(part, one, 1 / 8), 8) for part, one in zip(parts, whole, strict=True)
    ]
    held = np.mean([low <= 8**-0.5 <= high for low, high in ends])
    assert 0.93 <= held <= 0.97


def levels_of(pool: np.ndarray, joined: int = 0) -> list[Level]:
    """4, 8, 16 ... replicas of a pool, a CPU second each."""
    found = []
    for count in (4, 8, 16, 32, 64):
        parts = pool[: len(pool) // count * count].reshape(-1, count).mean(axis=1)
        rms = rms_error(parts, pool.mean(), count / len(pool))
        said = student_quantile(count - 1) / np.sqrt(count)
        found.append(
            Level(
                count,
                len(parts),
                rms,
                *rms_interval(rms, len(parts)),
                said,
                float(count),
                count <= joined,
            )
        )
    return found


def test_law_is_found_exactly_and_its_interval_holds_the_truth() -> None:
    costs = [1.0, 2.0, 5.0]
    exact = fitted(costs, [3.0 * c**-0.5 for c in costs], [9, 5, 4])
    assert (exact.scale, exact.power) == (pytest.approx(3.0), pytest.approx(0.5))
    assert exact.halving[0] == pytest.approx(4.0)
    rng = np.random.default_rng(2)
    laws = [law_of(levels_of(pool), pool.tolist()) for pool in rng.normal(size=(40, 256))]
    assert np.mean([abs(law.power - 0.5) <= law.half_width for law in laws]) >= 0.85
    assert np.mean([law.power for law in laws]) == pytest.approx(0.5, abs=0.05)
    assert Law(1.0, 0.2, 0.3).halving[2] == np.inf  # an interval that reaches "never" says so


def test_levels_where_triangles_are_taken_together_are_left_out_of_the_law() -> None:
    pool = np.random.default_rng(3).normal(size=256)
    first, *others = levels_of(pool, joined=4)
    spoilt = Level(4, first.blocks, 30.0, 20.0, 40.0, 30.0, 4.0, joined=True)
    assert law_of([spoilt, *others], pool.tolist()).power == law_of(others, pool.tolist()).power


def test_nothing_beats_what_is_on_the_front_and_all_else_is_beaten() -> None:
    assert front([1, 2, 3, 3, 4], [5, 6, 2, 1, 1]) == [0, 3]
    cost, error = np.random.default_rng(4).uniform(size=(2, 200))
    on = front(cost, error)
    for i in range(200):
        beaten = (
            (cost <= cost[i]) & (error <= error[i]) & ((cost < cost[i]) | (error < error[i]))
        ).any()
        assert beaten == (i not in on)
    assert list(cost[on]) == sorted(cost[on])


# Recommendations


def rung(
    knob: str,
    setting: Any,
    cpu: float,
    bias: float = 0.0,
    unsure: float = 0.0,
    mean_bias: float = 0.0,
) -> Run:
    """100 replicas of standard deviation 0.02, or of a quarter or four times the simulated time."""
    stretch = {"0.375": 4.0, "6": 0.25}.get(str(setting), 1.0) if knob == TIME else 1.0
    noise = np.random.default_rng(5).normal(size=100)
    goal = estimate(0.3 + 0.02 * np.sqrt(stretch) * (noise - noise.mean()) / noise.std(ddof=1))
    return Run(
        knob,
        str(setting),
        100,
        Estimate(cpu, 1e-3 * cpu),
        goal,
        goal,
        Estimate(bias, unsure),
        Estimate(mean_bias, 0.0),
    )


def ladder_of(*rungs: Run, dents: tuple[Run, ...] = ()) -> ConvergenceStudy:
    """A replica costs 0.05 s + 0.1 s for each of 1.5 s recorded and 0.8 s of warm-up."""
    design = load_design(DESIGNS / "gear.toml")
    settings = {FACETS: 256, MOTION: "sinusoidal", WARM_UP: 0.8, FLOOR: 1.0, TIME: 1.5}
    times = [rung(TIME, 0.375, 0.1675), rung(TIME, 6, 0.73), rung(WARM_UP, 0.2, 0.22, 0.0, 0.03)]
    levels = tuple(
        Level(
            k, 400 // k, 0.02 / k**0.5, 0.01, 0.1, student_quantile(k - 1) * 0.02 / k**0.5, 0.28 * k
        )
        for k in (4, 8, 16, 32)
    )
    law = Law(1.96 * 0.02 * 0.28**0.5, 0.5, 0.05)
    return ConvergenceStudy(
        design,
        settings,
        rung("reference", "", 0.28),
        (*times, *rungs),
        levels,
        law,
        dents,
        20.0,
        300.0,
        150,
    )


def test_cost_of_a_replica_is_a_line() -> None:
    line = cost(ladder_of())
    assert (line.fixed, line.pace) == (pytest.approx(0.05), pytest.approx(0.1))


def test_replicas_are_those_whose_interval_is_as_narrow() -> None:
    needed = replicas_for(ladder_of(), 0.001, 1.5)
    assert (
        student_quantile(needed - 1) * 0.02 / needed**0.5
        <= 0.001
        < student_quantile(needed - 2) * 0.02 / (needed - 1) ** 0.5
    )
    assert replicas_for(ladder_of(), 0.001, 6.0) == pytest.approx(needed / 4, rel=0.02)
    assert replicas_for(ladder_of(), 0.5, 1.5) == 4  # fewer were not tried


def test_cheapest_setting_within_a_third_of_the_accuracy_is_taken() -> None:
    coarse, middle = rung(FACETS, 16, 0.14, 0.004, 0.001), rung(FACETS, 64, 0.21, 0.001, 0.001)
    ladder = ladder_of(coarse, middle, rung(FLOOR, 100, 0.2799))
    loose, usual, tight = (recommend(ladder, accuracy) for accuracy in (0.05, 0.01, 0.001))
    assert [one.settings[FACETS] for one in (loose, usual, tight)] == [16, 64, 256]
    assert usual.settings[FLOOR] == 1.0  # a coarser floor saves no more than chance
    assert usual.settings[WARM_UP] == 0.8  # its bias is not known to 0.0033
    assert any(WARM_UP in text and "cannot tell" in text for text in usual.remarks)
    assert (
        tight.settings[TIME] == 6.0
    )  # what warm-up and start cost is shared by more recorded time
    seconds = tight.settings[TIME] + tight.settings[WARM_UP]
    assert tight.cpu_s == pytest.approx(tight.replicas * (0.05 + 0.1 * seconds))
    assert usual.cpu_s < tight.cpu_s / 50


def test_out_of_reach_is_said() -> None:
    advice = recommend(ladder_of(), 1e-5)
    assert advice.replicas == 0
    assert "not reachable within the ladder" in advice.lines[0]
    assert all(line.startswith("#") for line in advice.lines)


def test_rates_that_differ_from_dents_one_by_one_are_remarked_on() -> None:
    dents = tuple(
        rung("process.accuracy.coverage_model", name, 2.0, mean_bias=off)
        for name, off in (
            ("avrami", 0.011),
            ("dents, sample_mm 0.2", 0.0005),
            ("dents, sample_mm 0.1", 0.0),
        )
    )
    assert not any("rates give" in text for text in recommend(ladder_of(dents=dents), 0.05).remarks)
    [said] = [
        text for text in recommend(ladder_of(dents=dents), 0.01).remarks if "rates give" in text
    ]
    assert "+0.0110" in said
    assert 'coverage_model = "dents", sample_mm = 0.2' in said


def test_front_has_no_bias_that_is_not_known_to_be_small() -> None:
    unknown, known = rung(FACETS, 16, 0.2, 0.0, 0.3), rung(FACETS, 64, 0.14, 0.0, 0.0005)
    names = [one.name for one in choices(ladder_of(unknown, known))]
    assert any("facets 64" in name for name in names)
    assert not any("facets 16" in name for name in names)
    assert "independent replicas promise 4" in explained(ladder_of())


# Settings


def test_every_rung_is_one_knob_off_the_reference() -> None:
    own = plate_design()
    settings, ladder = designs(own)
    (_, reference), *others = ladder.items()
    assert others[-1][1] == own
    for (knob, setting), design in others[:-1]:
        restored = design.changed({knob: settings[knob]})
        assert restored == reference != design
        assert setting
    assert settings[MOTION] == "sinusoidal"
    assert settings[TIME] == own.process.accuracy.simulated_time_s
    assert PIECE not in settings
    effects = own.effects.model_copy(update={"drag": True})
    assert knobs(own.model_copy(update={"effects": effects}))[PIECE] == (40.0, 10.0, 2.5)


# The command


def played(design: Any, chamber: Any, mesh: Any, number: int) -> tuple[Tally, float]:
    """Dents at random, a quarter more per second on later triangles; fewer facets give fewer."""
    seconds = design.process.recorded_time
    rng = np.random.default_rng([number, round(1e6 * seconds)])
    slant = np.linspace(0.8, 1.2, len(chamber.exposed_area)) * (
        0.9 if design.chamber.facets == 16 else 1.0
    )
    dents = rng.poisson(2e6 * seconds * chamber.exposed_area * slant)
    return equal_dents(seconds, dents, 2e-7), 0.002 + 0.01 * (
        seconds + design.process.accuracy.warmup_time
    )


def marked(
    design: Any, chamber: Any, mesh: Any, samples: Any, number: int
) -> tuple[Tally, list[Any], list[float]]:
    dents, cpu = played(design, chamber, mesh, number)
    share = -np.expm1(-dents.dented_area / np.maximum(chamber.exposed_area, 1e-12))
    return dents, [share + 0.01, share, share], [cpu, 2 * cpu, 3 * cpu, 5 * cpu]


@pytest.fixture
def no_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(climbing, "_replica", played)
    monkeypatch.setattr("chamberopt.simulation.convergence.dent_runs._marked", marked)
    monkeypatch.setattr("chamberopt.cli.commands.accuracy.compile_simulator", lambda *_: None)


@pytest.mark.usefixtures("no_simulator")
def test_command_leaves_table_diagram_and_lines_to_paste(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(
        [
            "accuracy",
            str(DESIGNS / "plate.toml"),
            "--out",
            str(tmp_path / "out"),
            "--budget-s",
            "2",
            "--json",
        ]
    )
    told = json.loads(capsys.readouterr().out)
    assert status == 0
    folder = Path(told["folder"])
    assert {path.name for path in folder.iterdir()} == {
        "accuracy.json",
        "accuracy.csv",
        "accuracy.png",
        "design.toml",
    }
    assert (folder / "accuracy.png").stat().st_size > 20_000
    with (folder / "accuracy.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert (
        json.loads((folder / "accuracy.json").read_text(encoding="utf-8"))["rows"] == told["rows"]
    )
    assert {row["knob"] for row in rows} >= {
        FACETS,
        MOTION,
        WARM_UP,
        FLOOR,
        TIME,
        "reference",
        "replicas",
    }
    coarse = next(row for row in told["rows"] if (row["knob"], row["setting"]) == (FACETS, "16"))
    assert (
        coarse["bias_mean_coverage"] < -coarse["bias_mean_coverage_half_width"] < 0
    )  # a tenth fewer dents are seen
    assert told["cpu_s"] >= 1.5
    design = load_design(folder / "design.toml")
    for advice in told["recommendations"]:
        pasted = tomllib.loads("\n".join(advice["lines"]))["process"]["accuracy"]
        assert design.changed({f"process.accuracy.{name}": value for name, value in pasted.items()})


@pytest.mark.usefixtures("no_simulator")
def test_command_prints_what_it_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(
            [
                "accuracy",
                str(DESIGNS / "plate.toml"),
                "--out",
                str(tmp_path / "out"),
                "--budget-s",
                "0.01",
            ]
        )
        == 0
    )
    said = capsys.readouterr().out
    for words in (
        "reference: 33 replicas",
        "only the finest facets",
        "halving the error costs",
        "Pareto front",
    ):
        assert words in said
    assert said.count("[process.accuracy]") == 3


@pytest.mark.usefixtures("no_simulator")
def test_no_dents_no_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    def bare(design: Any, chamber: Any, *_: Any) -> Any:
        return equal_dents(1.0, np.zeros(len(chamber.exposed_area), int), 1e-7), 0.01

    monkeypatch.setattr(climbing, "_replica", bare)
    assert (
        main(
            [
                "accuracy",
                str(DESIGNS / "plate.toml"),
                "--out",
                str(tmp_path / "out"),
                "--budget-s",
                "0.01",
            ]
        )
        == 2
    )
    assert "no dent on the target was simulated" in capsys.readouterr().err


@pytest.mark.parametrize("budget", ["0", "-1", "nan", "inf"])
def test_a_budget_that_is_none_is_refused(
    budget: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [
        "accuracy",
        str(DESIGNS / "plate.toml"),
        "--out",
        str(tmp_path / "out"),
        f"--budget-s={budget}",
    ]
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert "--budget-s: given" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()
