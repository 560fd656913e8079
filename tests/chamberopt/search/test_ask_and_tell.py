"""A search that a laboratory answers: figures are told, and what makes no sense is refused."""

import math
import re
from collections import deque
from pathlib import Path

import pytest

import chamberopt
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.search.ask_and_tell import most_evaluations
from chamberopt.search.run_sweep import plan_sweep
from chamberopt.search.study import Study
from tests.helpers.known_optima import GEAR, NO_FRILLS, VARY, bowl, bowl_shares
from tests.helpers.studies import assert_total_never_grows, run_in_folder
from tests.helpers.synthetic import judged

ROOT = Path(__file__).parents[3]
LIMITED = {"mean_coverage": {"max": 0.5}}


def study(optimizer: dict | None = None, **tables) -> Study:
    settings = {"evaluations": 12, "confirm": 2, "confirm_replicas": 3, **NO_FRILLS}
    return Study(design=GEAR, vary=VARY, optimizer=settings | (optimizer or {}), **tables)


def measure(candidate, spread: float = 0.01) -> Estimate:
    middle = bowl(bowl_shares(candidate.design))
    return estimate([middle - spread, middle, middle + spread])


def answered(search: chamberopt.Search, figures) -> chamberopt.Search:
    while (candidate := search.ask()) is not None:
        search.tell(candidate, figures(candidate))
    return search


def test_the_example_of_the_docs_finds_its_optimum(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs/how_to/study.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(ROOT)
    names: dict = {}
    exec(example, names)
    best = names["search"].best
    assert best.parameters["chamber.height_mm"] == pytest.approx(50.0, abs=4.0)
    assert best.parameters["shot.mass_g"] == pytest.approx(6.0, abs=1.0)
    assert str(best.goals[0]) in capsys.readouterr().out


def test_told_figures_lead_where_simulated_ones_do(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        middle = bowl(bowl_shares(design))
        return judged([middle - 0.01, middle, middle + 0.01])

    question = study()
    simulated = run_in_folder(question, tmp_path / "out", SerialExecutor(), simulator=simulator)
    search = answered(chamberopt.Search(question), lambda one: {"uniform_coverage": measure(one)})
    assert [one.point for one in search.trials] == [one.point for one in simulated.trials]
    assert [one.score for one in search.trials] == [one.score for one in simulated.trials]
    assert search.best.parameters == simulated.best.parameters
    assert search.ask() is None


@pytest.mark.parametrize("algorithm", ["auto", "LN_BOBYQA", "GN_CRS2_LM", "sobol"])
def test_the_same_figures_lead_to_the_same_candidates(algorithm: str) -> None:
    """Two searches in turn do not disturb each other."""
    question = study({"algorithm": algorithm, "evaluations": 15})
    pair = chamberopt.Search(question), chamberopt.Search(question)
    while (asked := [search.ask() for search in pair])[0] is not None:
        assert asked[0].parameters == asked[1].parameters
        for search, candidate in zip(pair, asked, strict=True):
            search.tell(candidate, {"uniform_coverage": measure(candidate)})
    assert asked[1] is None
    assert pair[0].best.parameters == pair[1].best.parameters


def test_plain_numbers_intervals_and_limits() -> None:
    question = study(constraints=LIMITED)
    search = chamberopt.Search(question)
    assert search.figures == ("uniform_coverage", "mean_coverage")

    def figures(candidate) -> dict:
        shares = bowl_shares(candidate.design)
        return {"uniform_coverage": bowl(shares), "mean_coverage": Estimate(shares[0], 0.02)}

    best = answered(search, figures).best
    assert bowl_shares(best.design)[0] < 0.5
    assert best.feasible
    assert bowl(bowl_shares(best.design)) > 0.7


def test_two_objectives_and_a_time() -> None:
    pair = ("uniform_coverage", "minus_time_to_98_s")
    question = study(objective={"pareto": pair}, constraints={"time_to_98_s": {"max": 500.0}})
    search = chamberopt.Search(question)
    assert search.figures == (*pair, "time_to_98_s")

    def figures(candidate) -> dict:
        seconds = 100.0 + 500.0 * bowl_shares(candidate.design)[1]
        values = measure(candidate), Estimate(-seconds, 5.0), Estimate(seconds, 5.0)
        return dict(zip(search.figures, values, strict=True))

    answered(search, figures)
    assert search.best.feasible
    assert len(search.best.goals) == 2


def test_a_batch_is_out_at_a_time_and_a_failure_goes_on() -> None:
    search = chamberopt.Search(study({"batch": 3}))
    out: deque = deque()
    most = 0
    while (candidate := search.ask()) is not None or out:
        if candidate is not None:
            out.append(candidate)
            most = max(most, len(out))
            continue
        told = out.popleft()
        fails = told.number == 4
        search.tell(told, "the shot jammed" if fails else {"uniform_coverage": measure(told)})
    assert most == 3
    assert search.trials[4].reason == "the shot jammed"
    assert [one.number for one in search.trials] == list(range(len(search.trials)))
    assert bowl(bowl_shares(search.best.design)) > 0.75


def test_a_design_that_cannot_be_is_not_asked_for() -> None:
    """The part must be below the ceiling."""
    space = {"chamber.height_mm": (20.0, 60.0), "chamber.sonotrode_distance_mm": (5.0, 44.0)}
    settings = {"evaluations": 14, "batch": 2, "algorithm": "sobol"}
    search = chamberopt.Search(Study(design=GEAR, vary=space, optimizer=settings))
    asked = []

    def figures(candidate) -> dict:
        asked.append(candidate.number)
        return {"uniform_coverage": candidate.design.value("chamber.height_mm") / 100.0}

    answered(search, figures)
    failed = [one.number for one in search.trials if not one.goals]
    assert failed
    assert sorted(asked + failed) == list(range(len(search.trials)))
    assert "not below chamber.height_mm" in search.trials[failed[0]].reason


class TestWhatMakesNoSense:
    """One error each, after which the search goes on as if nothing had been told."""

    figure = {"uniform_coverage": 0.5}  # noqa: RUF012

    def refused(self, search, candidate, figures, said: str) -> None:
        before = len(search.trials)
        with pytest.raises(InputError, match=said):
            search.tell(candidate, figures)
        assert len(search.trials) == before

    def test_out_of_order(self) -> None:
        search = chamberopt.Search(study({"batch": 2}))
        first, second = search.ask(), search.ask()
        assert search.ask() is None
        self.refused(search, second, self.figure, "candidate 2 comes after 1, which has no figures")
        search.tell(first, self.figure)
        search.tell(second, self.figure)

    def test_twice(self) -> None:
        search = chamberopt.Search(study())
        first = search.ask()
        search.tell(first, self.figure)
        self.refused(search, first, self.figure, "candidate 1 was told already")
        assert search.ask() is not None
        self.refused(search, first, self.figure, "candidate 1 was told already")

    @pytest.mark.parametrize("stranger", [None, {"chamber.height_mm": 40.0}, "another"])
    def test_a_candidate_of_nobody(self, stranger: object) -> None:
        search = chamberopt.Search(study())
        search.ask()
        given = chamberopt.Search(study()).ask() if stranger == "another" else stranger
        self.refused(search, given, self.figure, "give a candidate that ask returned")

    @pytest.mark.parametrize(
        "value", [math.nan, math.inf, Estimate(math.nan, 0.1), Estimate(0.5, -1.0), "0.5", None]
    )
    def test_no_finite_figure(self, value: object) -> None:
        search = chamberopt.Search(study())
        said = "uniform_coverage: given .*; give a finite number"
        self.refused(search, search.ask(), {"uniform_coverage": value}, said)

    def test_a_figure_is_missing(self) -> None:
        search = chamberopt.Search(study(constraints=LIMITED))
        said = "mean_coverage is missing; give uniform_coverage, mean_coverage"
        self.refused(search, search.ask(), self.figure, said)

    def test_a_start_without_figures(self) -> None:
        search = chamberopt.Search(study())
        self.refused(search, search.ask(), "no time", r"the design as it is has no figures \(no t")

    def test_the_best_before_the_end(self) -> None:
        search = chamberopt.Search(study())
        search.tell(search.ask(), self.figure)
        with pytest.raises(InputError, match="the search goes on"):
            _ = search.best


def test_a_sweep_asks_for_its_list() -> None:
    points = plan_sweep(study(), 3, None).points
    search = chamberopt.Search(study(), points=points)
    asked = list(iter(search.ask, None))
    assert [one.point.tolist() for one in asked] == points.tolist()
    for candidate in asked:
        search.tell(candidate, {"uniform_coverage": measure(candidate)})
    assert len(search.trials) == len(points) == 9


def test_no_more_is_done_than_was_evaluated() -> None:
    told: list[tuple[int, int, float | None]] = []
    search = chamberopt.Search(study(), progress=lambda *now: told.append(now))
    seen = []
    while (candidate := search.ask()) is not None:
        search.tell(candidate, {"uniform_coverage": measure(candidate)})
        seen.append((len(search.trials), told[-1][0]))
    assert all(0 < done <= evaluated for evaluated, done in seen)
    assert_total_never_grows(told)
    searched = sum(one.stage == "search" for one in search.trials)
    assert (searched, told[0][1]) == (12, most_evaluations(study()))
    best = [one for *_, one in told[:searched]]
    assert best == [max(one.score for one in search.trials[:k]) for k in range(1, searched + 1)]
