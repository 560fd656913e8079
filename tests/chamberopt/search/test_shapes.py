"""Studies that choose the shape of the chamber: each has parameters of its own."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design
from chamberopt.documents.study import evaluated
from chamberopt.documents.wording import Label
from chamberopt.pictures.charts.study import convergence_picture, slices_picture
from chamberopt.search.optimiser.domain import Axis, Domain
from chamberopt.search.run_study import StudyResult
from chamberopt.search.run_sweep import plan_sweep
from chamberopt.search.study import Study
from chamberopt.search.study.parameters import NONE, ParameterSpace
from chamberopt.search.trial_log import read_trials, trials_as_csv
from chamberopt.simulation.evaluation import Evaluation
from tests.helpers.known_optima import NO_FRILLS
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import DESIGNS, judged

PLATE = load_design(DESIGNS / "plate.toml")
VARY = {
    "chamber.shape": {"choose": ["cylinder", "prism", "box"]},
    "chamber.diameter_mm": (44.0, 56.0),
    "chamber.across_mm": (44.0, 56.0),
    "chamber.sides": (4, 8),
    "chamber.length_mm": (44.0, 60.0),
    "chamber.width_mm": (44.0, 60.0),
    "shot.mass_g": (1.5, 8.0),
}

FEW = {name: VARY[name] for name in list(VARY)[:4]}
FEW["chamber.shape"] = {"choose": ["cylinder", "prism"]}
PRISM = {
    "chamber.shape": "prism", "chamber.diameter_mm": NONE, "chamber.across_mm": 50.0,
    "chamber.sides": 6.0,
}  # fmt: skip


def study(vary: object = VARY, **tables: object) -> Study:
    return validate(Study, {"design": PLATE, "vary": vary, **tables})


def by_shape(design: Design, stream: str, replicas: int | None) -> Evaluation:
    """The best is a prism of 6 sides, 50 mm across, with 4 g."""
    chamber = design.chamber
    height = 0.5 - 0.01 * (design.shot.mass_g - 4.0) ** 2
    if chamber.shape == "prism":
        height += 0.2 - 0.02 * abs(chamber.sides - 6) - 2e-3 * (chamber.across_mm - 50.0) ** 2
    return judged(height + 1e-3 * np.array([-1.0, 0.0, 1.0]))


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    settings = {"evaluations": 45, "confirm": 2, "confirm_replicas": 3, **NO_FRILLS}
    folder = tmp_path_factory.mktemp("shapes") / "study"
    question = study(optimizer=settings)
    return run_in_folder(question, folder, SerialExecutor(), simulator=by_shape)


def test_a_point_has_only_the_parameters_of_its_shape() -> None:
    space = ParameterSpace(PLATE, study().vary)
    assert space.values_at(space.start)["chamber.sides"] == NONE
    prism = space.values_at(np.array([0.5, 0.2, 0.5, 0.6, 0.3, 0.4, 0.5]))
    assert prism == {
        "chamber.shape": "prism", "chamber.diameter_mm": NONE, "chamber.across_mm": 50.0,
        "chamber.sides": 6.0, "chamber.length_mm": NONE, "chamber.width_mm": NONE,
        "shot.mass_g": 4.75,
    }  # fmt: skip
    design = space.design_at(np.array([0.5, 0.2, 0.5, 0.6, 0.3, 0.4, 0.5]))
    assert (design.chamber.shape, design.chamber.sides) == ("prism", 6)
    assert design.chamber.height_mm == PLATE.chamber.height_mm
    one, other = np.array([[0.5, 0.2, 0.5, 0.6, 0.3, 0.4, 0.5], [0.5, 0.9, 0.5, 0.6, 0.8, 0, 0.5]])
    np.testing.assert_array_equal(*space.domain.snap(np.stack([one, other])))


def test_texts_of_a_shape_can_vary_and_a_search_begin_with_another_shape() -> None:
    hull = {"chamber.outline": {"choose": ["hull", "silhouette"]}, "chamber.gap_mm": (12.0, 15.0)}
    shapes = {"chamber.shape": {"choose": ["cylinder", "conformal"]}}
    space = ParameterSpace(PLATE, study(shapes | hull).vary)
    assert space.values_at(space.start)["chamber.outline"] == NONE
    found = space.design_at(np.array([1.0, 1.0, 0.5]))
    assert (found.chamber.shape, found.chamber.outline) == ("conformal", "silhouette")
    question = study(FEW, begin_with=[PRISM])
    space = ParameterSpace(PLATE, question.vary)
    point = space.domain.snap(space.point_of(question.begin_with[0])[None])[0]
    assert space.values_at(point) == PRISM


def test_points_of_few_levels_are_counted_by_shape() -> None:
    """Two values of x in the first of three choices, and three of y in all."""
    axes = [Axis(3, ordered=False), Axis(2, where=(0, frozenset({0}))), Axis(3)]
    assert Domain(axes).size == 2 * 3 + 3 + 3


def test_the_best_shape_is_found_with_its_own_numbers(
    searched: StudyResult, tmp_path: Path
) -> None:
    best = searched.best.design
    assert (best.chamber.shape, best.chamber.sides) == ("prism", 6)
    assert best.value("chamber.across_mm") == pytest.approx(50.0, abs=1.5)
    assert best.value("shot.mass_g") == pytest.approx(4.0, abs=0.7)
    assert {t.parameters["chamber.shape"] for t in searched.trials} == {"cylinder", "prism", "box"}
    assert searched.trials[0].parameters["chamber.across_mm"] == NONE
    assert f",{NONE}," in trials_as_csv(read_trials(searched.folder), {})
    found = searched.sensitivity
    assert found is not None
    assert {one.name for one in found.slices} == {
        "chamber.shape", "chamber.across_mm", "chamber.sides", "shot.mass_g",
    }  # fmt: skip
    assert found.slices[0].flat == ("prism",)
    candidates = [evaluated(one, Label("score")) for one in searched.trials]
    convergence_picture(tmp_path / "convergence.png", searched, candidates, Label("score"))
    slices_picture(tmp_path / "slices.png", searched, found, Label("score"))
    assert not any("chamber.diameter_mm" in note for note in searched.notes)


def test_it_is_resumed_to_the_same_bytes(searched: StudyResult, tmp_path: Path) -> None:
    shutil.copytree(searched.folder, tmp_path / "again")
    log = tmp_path / "again" / "history.jsonl"
    whole = log.read_bytes()
    log.write_bytes(b"".join(whole.splitlines(keepends=True)[:20]))
    run_in_folder(searched.study, tmp_path / "again", simulator=by_shape)
    assert log.read_bytes() == whole


@pytest.mark.parametrize(
    ("vary", "tables", "said"),
    [
        ({"chamber.shape": {"choose": ["cylinder", "prism"]}}, {}, r"'prism'.*across_mm.*lacks"),
        ({"chamber.shape": {"choose": ["cylinder", "cone"]}}, {}, "given 'cone'"),
        ({"chamber.shape": {"choose": ["box", "prism"]}}, {}, "starts at 'cylinder'"),
        ({"chamber.sides": (4, 8)}, {}, "chamber.sides"),
        (VARY, {"constraints": {"chamber.sides": {"min": 5}}}, "only some of the shapes have it"),
        ({**VARY, "chamber.sides": (4.5, 8)}, {}, "whole bounds"),
        ({**VARY, "chamber.across_mm": (1.0, 56.0)}, {}, "chamber.across_mm"),
        ({**VARY, "chamber.gap_mm": (1.0, 5.0)}, {}, "chamber.gap_mm"),
        (FEW, {"begin_with": [PRISM | {"chamber.sides": NONE}]}, "a prism has it"),
        (FEW, {"begin_with": [PRISM | {"chamber.diameter_mm": 50}]}, "a prism has none"),
    ],
)
def test_what_no_shape_has_is_refused(vary: dict, tables: dict, said: str) -> None:
    with pytest.raises(InputError, match=f"(?s){said}"):
        study(vary, **tables)


def test_a_sweep_takes_one_shape() -> None:
    with pytest.raises(InputError, match="sweep each shape by itself"):
        plan_sweep(study(), None, 8)
