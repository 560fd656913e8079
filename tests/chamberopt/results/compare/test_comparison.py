"""Results side by side: differing parameters are named and differences have intervals.

The number of replicas that would make a difference clear is foretold correctly.
"""

import json
import shutil
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.metrics import NEVER, find_metric
from chamberopt.coverage.stress_knowledge import BANDS, stress_bands
from chamberopt.design.calibration import Calibration, LawCalibration, Misfit, law_metal
from chamberopt.design.load import load_design
from chamberopt.documents.comparison import after_shorter_time, comparison_end, comparison_lines
from chamberopt.documents.wording import metric_label, objective_label
from chamberopt.page.acts import list_results
from chamberopt.printers import terminal
from chamberopt.results.arrays_file import ResultArrays
from chamberopt.results.command_records import difference_record
from chamberopt.results.compare.comparison import (
    Comparison,
    _by_the_law,
    compare,
    coverage_after,
    values_before,
)
from chamberopt.results.compare.difference import MAX_TIME_RATIO, confidence_of_each, difference
from chamberopt.results.load import load_result
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.workflows import comparison_folder
from chamberopt.workflows.comparison_folder import write_comparison
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.results.arrays import change_arrays
from tests.helpers.results.digests import accept_changes
from tests.helpers.synthetic import DESIGNS, machine_values, plate_design, poisson_evaluation

plate = partial(plate_design, process__accuracy__points=1000)
OF_LAW = BANDS["compression_depth_um"] - 1.0  # error of the depth
PLATE = plate()
CHAMBER = build_chamber(PLATE)


def comparison_text(comparison: Comparison) -> str:
    return terminal.text(comparison_lines(comparison))


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: "skipped")
    for name in ("draw_coverage", "draw_difference"):
        monkeypatch.setattr(comparison_folder, name, lambda *_: "skipped")


@pytest.fixture(scope="module", autouse=True)
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results as they were saved, which tests copy: most take some that others take too."""
    global MADE
    MADE = tmp_path_factory.mktemp("made")
    return MADE


@cache
def random_dents(per_mm2: float, seed: int) -> Evaluation:
    return poisson_evaluation(PLATE, CHAMBER, per_mm2, 6, seed)


def left(folder: Path, per_mm2: float, seed: int = 0, design=PLATE, **changes: object) -> Path:
    if design is not PLATE:
        save_simulation(
            folder, design, CHAMBER, poisson_evaluation(design, CHAMBER, per_mm2, 6, seed)
        )
    elif changes:
        evaluation = replace(random_dents(per_mm2, seed), **changes)
        save_simulation(folder, design, CHAMBER, evaluation)
    else:
        saved = MADE / f"{per_mm2} {seed}"
        if not saved.exists():
            save_simulation(saved, design, CHAMBER, random_dents(per_mm2, seed))
        shutil.copytree(saved, folder)
    return folder


def row(text: str, name: str) -> str:
    return next(line for line in text.splitlines() if line.startswith(name))


def test_the_same_twice(tmp_path: Path) -> None:
    both = compare([left(tmp_path / "a", 60), left(tmp_path / "b", 60, design=plate())])
    assert both.parameters == {}
    for name, (gap,) in both.differences.items():
        assert gap.value == 0.0
        assert gap.paired
        assert not gap.real
        assert gap.time_ratio is None
        # The bias of these knows nothing of pairs.
        metric = find_metric(name)
        if metric is None or not metric.of_places:
            assert gap.half_width == 0.0, name
    depth, (gap,) = (both.metrics["compression_depth_um"][0],
                     both.differences["compression_depth_um"])  # fmt: skip
    assert gap.half_width < 0.5 * OF_LAW * depth.value  # which is common to both
    text = comparison_text(both)
    assert "the designs do not differ" in text
    assert row(text, "mean_coverage").endswith("exact")
    assert "b - a: on the same seeds" in text


def test_the_error_of_the_depth_is_not_common_to_two_metals(tmp_path: Path) -> None:
    other = plate(materials__part__tensile_MPa=500.0)
    both = compare([left(tmp_path / "a", 10), left(tmp_path / "other", 10, design=other)])
    (apart,) = both.differences["compression_depth_um"]
    assert (
        apart.half_width
        > 0.999 * np.sqrt(2.0) * OF_LAW * both.metrics["compression_depth_um"][0].value
    )


def test_the_error_of_the_law_stays_where_one_result_has_a_measured_profile(tmp_path: Path) -> None:
    """The depth of the second is .8 of the first by the factor alone; the band has 1.6 for it."""
    law = LawCalibration(
        metal=law_metal(PLATE.materials.part),
        log_mean=(np.log(0.8), 0.0, 0.0),
        log_covariance=tuple(map(tuple, (1e-4 * np.eye(3)).tolist())),
        misfit=Misfit(kind="stress profiles", chi2=10.0, values=12),
    )
    machine = Calibration(**machine_values(amplitude=1e-3), stress=(law,)).model_dump()
    factors = PLATE.changed({"calibration": machine})
    both = compare([left(tmp_path / "a", 10), left(tmp_path / "b", 10, design=factors)])
    (apart,) = both.differences["compression_depth_um"]
    first, second = both.metrics["compression_depth_um"]
    assert second.value == pytest.approx(0.8 * first.value, rel=1e-3)
    assert apart.half_width > OF_LAW * first.value
    assert not apart.real


def test_what_differs_is_named_and_measured(tmp_path: Path) -> None:
    heavier = plate(shot__mass_g=6.0, process__seed=2)
    both = compare([left(tmp_path / "light", 10), left(tmp_path / "heavy", 30, 1, heavier)])
    assert both.parameters["shot.mass_g"] == (PLATE.shot.mass_g, 6.0)
    assert set(both.parameters) == {"shot.mass_g", "process.seed"}
    assert both.labels == ("light", "heavy")
    lines = {row["folder"]: row["text"] for row in list_results(tmp_path, PLATE)}  # of the page
    assert str(lines["heavy"]).startswith("mass of the shot 6 g, seed of the process 2; ")
    assert str(lines["light"]).startswith(f"mass of the shot {PLATE.shot.mass_g:g} g, seed")
    first, second = both.metrics["mean_coverage"]
    (gap,) = both.differences["mean_coverage"]
    assert gap.value == pytest.approx(second.value - first.value)
    assert gap.real  # three times the dents
    # Other seeds: independent, so the variances add.
    assert not gap.paired
    assert gap.half_width == pytest.approx(np.hypot(first.half_width, second.half_width), rel=0.3)
    assert row(comparison_text(both), "mean_coverage").endswith("yes")
    assert "heavy - light: independent, on other seeds" in comparison_text(both)


@pytest.mark.parametrize(("share", "is_told"), [(1.002, False), (0.998, False), (1.02, True)])
def test_a_result_is_of_another_treatment_time_only_where_it_matters(
    share: float, is_told: bool
) -> None:
    result: Any = SimpleNamespace(design=PLATE)
    key, time = "process.treatment_time_s", PLATE.process.treatment_time_s
    before = values_before(result, PLATE.changed({key: share * time}))
    assert before == ({key: time} if is_told else {})


def test_pairs_by_hand() -> None:
    """Six differences from 1 to 6 have mean 3.5 and variance 3.5.

    The 97.5 % quantile of Student's t with 5 degrees of freedom is 2.5706.
    """
    before = estimate([10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
    after = estimate([11.0, 22.0, 33.0, 44.0, 55.0, 66.0])
    gap = difference(after, before, same_seeds=True)
    assert gap.value == pytest.approx(3.5)
    assert gap.half_width == pytest.approx(2.5706 * np.sqrt(3.5 / 6.0), rel=1e-4)
    assert gap.real
    apart = difference(after, before, same_seeds=False)
    assert (apart.paired, apart.real) == (False, False)
    expected = stats.ttest_ind(
        after.pseudovalues, before.pseudovalues, equal_var=False
    ).confidence_interval(0.95)
    assert (apart.value - apart.half_width, apart.value + apart.half_width) == pytest.approx(
        tuple(expected)
    )
    assert not difference(estimate([1.0, 2.0, 3.0, 4.0, 5.0]), before, same_seeds=True).paired


def test_several_later_candidates_widen_each_interval() -> None:
    """Bonferroni: with four the two-sided error of each is 1.25 %."""
    before, after = estimate([1.0, 2.0, 4.0, 8.0]), estimate([2.0, 2.5, 7.0, 9.0])
    confidence = confidence_of_each(4)
    assert confidence == pytest.approx(0.9875)
    one, four = (difference(after, before, True, c).half_width for c in (0.95, confidence))
    assert four / one == pytest.approx(stats.t.ppf(1 - 0.0125 / 2, 3) / stats.t.ppf(0.975, 3))


@pytest.mark.parametrize("paired", [True, False])
def test_simulated_so_much_longer_the_difference_shows_in_half_of_the_cases(paired: bool) -> None:
    rng = np.random.default_rng(1)
    count, true_gap, spread = 8, 0.3, 1.0
    noise = stats.zscore(rng.normal(size=(2, count)), axis=1, ddof=1) * spread
    if paired:  # the pairs' own scatter is the spread
        noise[0] = 0.0
    gap = difference(estimate(true_gap + noise[1]), estimate(noise[0]), same_seeds=paired)
    assert not gap.real
    assert gap.replicas is not None
    assert gap.time_ratio == pytest.approx(gap.replicas / count)
    # With many replicas the limit is 1.96 standard errors. The foretold number is not far above it,
    # because Student's t of more replicas is close to 1.96.
    limit = (1.96 * spread / true_gap) ** 2 * (1 if paired else 2)
    assert limit < gap.replicas < 1.2 * limit
    drawn = (
        rng.normal(0.0, spread, (2, 4000, gap.replicas)) + np.array([0.0, true_gap])[:, None, None]
    )
    if paired:
        found = stats.ttest_1samp(drawn[1], 0.0, axis=1).pvalue < 0.05
    else:
        found = stats.ttest_ind(drawn[1], drawn[0], axis=1, equal_var=False).pvalue < 0.05
    assert found.mean() == pytest.approx(0.5, abs=0.04)


def test_what_would_take_for_ever_is_not_foretold(tmp_path: Path) -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0])
    tiny = difference(estimate(values[::-1] + 1e-4), estimate(values), same_seeds=True)
    assert (tiny.real, tiny.time_ratio, tiny.replicas) == (False, None, None)
    both = compare([left(tmp_path / "a", 20), left(tmp_path / "b", 20)])
    text = comparison_text(replace(both, differences={name: (tiny,) for name in both.differences}))
    assert row(text, "mean_coverage").endswith(f"more than {MAX_TIME_RATIO} × as long")


@pytest.mark.parametrize("words", ["never", "more than 2,300 s", "not resolved"])
def test_a_figure_without_a_number_is_written_in_words_and_not_ranked(
    tmp_path: Path, words: str
) -> None:
    evaluation = random_dents(60, 0)
    without = Estimate(NEVER, 0.0, (NEVER,) * 6, in_words=words)
    metrics = {**evaluation.metrics, "time_to_98_s": without}
    both = compare([left(tmp_path / "a", 60), left(tmp_path / "b", 60, metrics=metrics)])
    (gap,) = both.differences["time_to_98_s"]
    assert not gap.real
    line = row(comparison_text(both), "time_to_98_s")
    assert words in line
    assert line.split()[-3:] == ["not", "known", "no"]
    assert "1000000" not in line
    assert both.metrics["time_to_98_s"][1].in_words == words
    assert difference_record(gap).half_width is None


def test_three_results_and_what_is_written(tmp_path: Path) -> None:
    folders = [left(tmp_path / name / "result", 60 + 60 * i, i) for i, name in enumerate("abc")]
    three = compare(folders)
    assert three.labels == ("a/result", "b/result", "c/result")
    assert len(three.differences["mean_coverage"]) == 2
    assert three.confidence == pytest.approx(0.975)
    assert "hold together with 95 % (Bonferroni)" in comparison_text(three)
    assert write_comparison(tmp_path / "out", three) == ["skipped"] * 2
    assert (tmp_path / "out" / "compare.txt").read_text() == comparison_text(three) + "\n"
    about = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert [gap["real"] for gap in about["differences_to_first"]["mean_coverage"]] == [True, True]
    assert len(about["coverage_against_time"][2]) > 5
    assert about["metrics"]["time_to_98_s"][0]["half_width"] > 0
    for name in ("coverage", "normal_speed", "angle"):
        histogram = about["distributions"][name]
        for shares in histogram["shares"]:
            assert len(shares) == len(histogram["edges"]) - 1
            assert sum(shares) == pytest.approx(1.0)
    # All synthetic impacts have 3 m/s and 70 degrees. The mean of the coverage's histogram is the
    # mean coverage.
    assert about["distributions"]["mean_normal_speed_m_s"] == pytest.approx([3.0] * 3)
    assert about["distributions"]["mean_angle_deg"] == pytest.approx([70.0] * 3)
    edges = np.array(about["distributions"]["coverage"]["edges"])
    for shares, mean in zip(
        about["distributions"]["coverage"]["shares"], three.metrics["mean_coverage"], strict=True
    ):
        assert 0.5 * (edges[1:] + edges[:-1]) @ shares == pytest.approx(
            100.0 * mean.value, abs=edges[1] - edges[0]
        )
    assert (tmp_path / "out" / "distributions.png").stat().st_size > 50_000
    with pytest.raises(InputError, match="nothing is ever overwritten"):
        write_comparison(tmp_path / "out", three)


def test_single_impacts_of_another_result_are_refused(tmp_path: Path) -> None:
    both = compare([left(tmp_path / "a", 20), left(tmp_path / "b", 30)])
    (tmp_path / "b" / "hits.npz").write_bytes((tmp_path / "a" / "hits.npz").read_bytes())
    with pytest.raises(InputError, match=r"b/hits\.npz: not the file that was written"):
        write_comparison(tmp_path / "out", both)
    accept_changes(tmp_path / "b")
    both = compare([tmp_path / "a", tmp_path / "b"])
    with pytest.raises(
        InputError, match=r"hits\.npz: its impacts are not those of the arrays\.npz beside it"
    ):
        write_comparison(tmp_path / "out", both)
    assert not (tmp_path / "out").exists()


def _with_less_target(arrays: ResultArrays) -> ResultArrays:
    part = arrays.chamber.part
    target = part.target.copy()
    target[np.flatnonzero(target)[:3]] = False
    chamber = replace(arrays.chamber, part=replace(part, target=target))
    elements = {**arrays.elements, "target": target.astype(np.uint8)}
    return replace(arrays, chamber=chamber, elements=elements)


def test_targets_of_other_triangles_are_refused(tmp_path: Path) -> None:
    both = compare([left(tmp_path / "a", 20), left(tmp_path / "b", 30)])
    change_arrays(tmp_path / "b", _with_less_target)
    both = compare([tmp_path / "a", tmp_path / "b"])
    with pytest.raises(InputError, match="its target of 333 triangles is not that of"):
        write_comparison(tmp_path / "out", both)
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_what_cannot_be_compared(tmp_path: Path) -> None:
    one = left(tmp_path / "one", 20)
    with pytest.raises(InputError, match="two or more"):
        compare([one])
    with pytest.raises(InputError, match="given twice"):
        compare([one, one / ".." / "one"])
    with pytest.raises(InputError, match="not a results folder"):
        compare([one, tmp_path])
    blade = load_design(DESIGNS / "blade.toml")
    other = build_chamber(blade)
    save_simulation(tmp_path / "blade", blade, other, poisson_evaluation(blade, other))
    with pytest.raises(InputError, match=r"another part \(blade.stl\).*plate.stl"):
        compare([one, tmp_path / "blade"])
    part = PLATE.part.model_copy(update={"target": type(PLATE.part.target)()})
    elsewhere = left(tmp_path / "all", 20, 0, PLATE.model_copy(update={"part": part}))
    with pytest.raises(InputError, match=r"part\.target differs"):
        compare([one, elsewhere])
    longer = left(tmp_path / "longer", 20, 0, plate(process__treatment_time_s=10))
    with pytest.raises(InputError, match=r"peened for 10 s.*for 5 s.*--treatment-time-s"):
        compare([one, longer])
    wider = left(tmp_path / "wider", 20, 0, plate(process__accuracy__gauge_mm2=4))
    with pytest.raises(InputError, match=r"gauge_mm2 is 4, in .* 1: .* different areas"):
        compare([one, wider])
    machines = [
        left(tmp_path / name, 20, 0, plate(calibration=machine_values(v0=sd)))
        for name, sd in (("mine", 0.1), ("yours", 0.2))
    ]
    with pytest.raises(InputError, match="another calibration than in"):
        compare(machines)
    compare([one, machines[0]])


def test_numbers_that_differ_are_told_in_words(tmp_path: Path) -> None:
    posed = plate(part__rotate_deg=[0, 0, 90], effects__part_turn={"rpm": 12.5})
    both = compare([left(tmp_path / "a", 60), left(tmp_path / "b", 60, design=posed)])
    text = terminal.text(comparison_end(both, False))
    assert row(text, "Part rotate [degrees]").split()[-3:] == ["0,", "0,", "90"]
    assert row(text, "Part turn [rpm]").split()[-2:] == ["-", "12.5"]


@pytest.mark.parametrize("names", [("b",), ("b", "c")])
def test_the_end_is_a_sentence_for_each_and_the_main_figures_in_words(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    """Of two the table has the difference, of more a mark on what differs from the first."""
    folders = [left(tmp_path / one, 60 + 30 * (one == "b"), seed=ord(one)) for one in ("a", *names)]
    both = compare(folders)
    end = comparison_end(both, False)
    text = terminal.text(end)
    mean = metric_label("mean_coverage")
    (gap, *_), values = both.differences["mean_coverage"], both.metrics["mean_coverage"]
    shown = row(text, mean.with_unit)
    assert all(mean.number(one) in shown for one in values)
    assert (f"{mean.number(gap.estimate, sign=True)} *" in shown) is (len(names) == 1)
    assert f"{mean.number(values[1])} *" in shown or len(names) == 1
    sentences = [one for one in end if isinstance(one, str) and " better " in one]
    if len(names) == 1:  # one sentence says which is better, and by how much
        goal = objective_label("uniform_coverage")
        (gap, *_), (low, high) = (
            both.differences["uniform_coverage"],
            both.metrics["uniform_coverage"],
        )
        change = goal.format(gap.estimate, sign=True).removeprefix("+")
        better = f"b is better than a: the {goal.text} is higher by {change}"
        assert sentences == [
            f"{better} ({goal.format(high)} against {goal.format(low)}; 95 % intervals)."
        ]
    else:
        assert len(sentences) + text.count("No difference is resolved between c and a: ") == 2
    assert "mean_coverage" not in text
    assert "mean_coverage" in terminal.text(comparison_end(both, True))


def test_results_of_different_times_are_compared_after_the_shorter(tmp_path: Path) -> None:
    """Dents come at a steady rate, so that the coverage after a time follows from its curve."""
    short = left(tmp_path / "short", 60)
    longer = plate(process__treatment_time_s=3.0 * PLATE.process.treatment_time_s)
    long = left(tmp_path / "long", 60, seed=2, design=longer)
    results = [load_result(short), load_result(long)]
    seconds = results[0].design.process.treatment_time
    at_once, after = (coverage_after(one, seconds) for one in results)
    assert at_once.value == pytest.approx(results[0].metrics["mean_coverage"].value, rel=0.02)
    assert after.value == pytest.approx(at_once.value, rel=0.1)
    assert coverage_after(results[1], 1e9) is None
    told, remedy = after_shorter_time(results, ("short", "long"))
    assert told.endswith(f" after {seconds:g} s, the shorter of both treatment times.")
    assert "simulate it again" in remedy
    with pytest.raises(InputError, match="cannot be compared"):
        compare([short, long])


def test_the_law_may_be_wrong_by_its_band_in_each_figure_that_it_gives() -> None:
    design = plate_design().changed({"materials.part": {"alloy": "7075-T6"}, "stress": {}})
    bands = stress_bands(design)
    assert bands
    for name, band in bands.items():
        for metric in (name, f"left.{name}"):
            like: Any = SimpleNamespace(
                design=design, objective_name="other", metrics={metric: Estimate(-3.0, 0.1)}
            )
            assert _by_the_law(metric, like) == pytest.approx(3.0 * (band - 1.0))
    assert _by_the_law("mean_coverage", like) == 0.0
