"""Studies that choose among texts, and step through the sizes in which balls are sold."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design, save_design
from chamberopt.design.materials import ball_sizes
from chamberopt.documents.study import evaluated, influences
from chamberopt.documents.wording import Label
from chamberopt.pictures.charts.study import convergence_picture, slices_figure, slices_picture
from chamberopt.pictures.charts.sweep import sweep_map
from chamberopt.results.write import study_record
from chamberopt.search.run_study import StudyResult
from chamberopt.search.run_sweep import plan_sweep
from chamberopt.search.study import Study
from chamberopt.search.study.parameters import ParameterSpace
from chamberopt.search.trial_log import read_trials, trials_as_csv
from chamberopt.simulation.evaluation import Evaluation
from tests.helpers.known_optima import NO_FRILLS
from tests.helpers.studies import run_in_folder, sweep_in_folder
from tests.helpers.synthetic import DESIGNS, judged

GEAR = load_design(DESIGNS / "gear.toml")
VARY = {
    "shot.material": {"choose": ["steel", "zirconia", "silicon_nitride"]},
    "shot.mass_g": (2.0, 10.0),
}
BEST = {"steel": 0.5, "zirconia": 0.6, "silicon_nitride": 0.4}


def study(vary: object = VARY, design: Design = GEAR, **tables: object) -> Study:
    return validate(Study, {"design": design, "vary": vary, **tables})


def by_material(design: Design, stream: str, replicas: int | None) -> Evaluation:
    height = BEST[design.shot.material] - 0.01 * (design.shot.mass_g - 7.0) ** 2
    return judged(height + 1e-3 * np.array([-1.0, 0.0, 1.0]))


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    """A search that begins with silicon nitride."""
    settings = {"evaluations": 14, "confirm": 2, "confirm_replicas": 3, **NO_FRILLS}
    first = [{"shot.material": "silicon_nitride", "shot.mass_g": 3.0}]
    question = study(optimizer=settings, begin_with=first)
    folder = tmp_path_factory.mktemp("choices") / "study"
    return run_in_folder(question, folder, SerialExecutor(), simulator=by_material)


def test_the_best_text_is_found_and_its_restitution_is_of_its_ball(
    searched: StudyResult, tmp_path: Path
) -> None:
    assert searched.trials[1].parameters["shot.material"] == "silicon_nitride"
    best = searched.best.design
    assert best.shot.material == searched.best.parameters["shot.material"] == "zirconia"
    assert best.value("shot.mass_g") == pytest.approx(7.0, abs=0.5)
    assert best.materials == GEAR.changed({"shot.material": "zirconia"}).materials
    assert best.materials.part.v0_m_s != GEAR.materials.part.v0_m_s
    save_design(best, tmp_path / "best.toml")
    assert load_design(tmp_path / "best.toml") == best
    assert not any("shot.material" in note for note in searched.notes)  # it has no bounds


def test_a_search_with_texts_is_resumed(searched: StudyResult, tmp_path: Path) -> None:
    shutil.copytree(searched.folder, tmp_path / "again")
    log = tmp_path / "again" / "history.jsonl"
    whole = log.read_bytes()
    log.write_bytes(b"".join(whole.splitlines(keepends=True)[:6]))
    again = run_in_folder(searched.study, tmp_path / "again", simulator=by_material)
    assert log.read_bytes() == whole
    assert again.best.parameters == searched.best.parameters


def test_tables_charts_and_sentences_have_the_texts(searched: StudyResult, tmp_path: Path) -> None:
    assert ",shot.material," in (table := trials_as_csv(read_trials(searched.folder), {}))
    assert ",silicon_nitride,3.0," in table
    found = searched.sensitivity
    assert found is not None
    material, mass = found.slices
    assert material.flat == ("zirconia",)
    np.testing.assert_array_equal(material.values, [0.0, 1.0, 2.0])
    recorded = study_record(searched).model
    assert recorded is not None
    assert recorded.parameters["shot.material"].choices == list(material.texts)
    assert recorded.parameters["shot.material"].flat == ["zirconia"]
    assert recorded.parameters["shot.mass_g"].flat == list(mass.flat)
    axis = Label("score")
    candidates = [evaluated(one, axis) for one in searched.trials]
    convergence_picture(tmp_path / "convergence.png", searched, candidates, axis)
    slices_picture(tmp_path / "slices.png", searched, found, axis)
    assert (tmp_path / "convergence.png").stat().st_size > 10_000
    places = searched.start.parameters, searched.best.parameters
    panel = slices_figure(found.slices, *places, "no loss", "score").axes[0]
    assert [text.get_text() for text in panel.get_xticklabels()] == [
        one.replace("_", " ") for one in material.texts
    ]


def test_the_report_has_the_texts(searched: StudyResult) -> None:
    assert searched.sensitivity is not None
    about = study_record(searched)
    assert about.vary["shot.material"] == ["steel", "zirconia", "silicon_nitride"]
    texts = {one.name: list(one.curve.texts) for one in influences(about, Label("score"))}
    assert texts == {"shot.material": about.vary["shot.material"], "shot.mass_g": []}
    assert about.best.parameters["shot.material"] == "zirconia"


def test_a_grid_has_all_texts_and_its_map_names_them(tmp_path: Path) -> None:
    question = study()
    plan = plan_sweep(question, 2, None)
    sweep = sweep_in_folder(
        question, plan, tmp_path / "grid", SerialExecutor(), simulator=by_material
    )
    assert [trial.parameters["shot.material"] for trial in sweep.trials] == [
        name for name in BEST for _ in range(2)
    ]
    assert sweep.best is not None
    assert sweep.best.parameters == {"shot.material": "zirconia", "shot.mass_g": 10.0}
    assert sweep_map(tmp_path / "map.png", sweep, Label("score")) == []
    one = study({"shot.material": VARY["shot.material"]})
    alone = sweep_in_folder(
        one, plan_sweep(one, 2, None), tmp_path / "one", SerialExecutor(), simulator=by_material
    )
    sweep_map(tmp_path / "curve.png", alone, Label("score"))


def test_texts_are_choices_of_a_model_in_the_order_of_the_file() -> None:
    vary = {**VARY, "sonotrode.motion": {"choose": ["random_phase", "sinusoidal"]}}
    space = ParameterSpace(GEAR, study(vary).vary)
    assert [(axis.levels, axis.ordered) for axis in space.domain.axes] == [
        (3, False),
        (0, True),
        (2, False),
    ]
    shares = np.linspace(0.0, 1.0, 9)[:, None] * [1.0, 1.0, 1.0]
    tried = [space.values_at(one)["shot.material"] for one in space.domain.snap(shares)]
    assert tried == [name for name in BEST for _ in range(3)]  # as often each
    values = space.values_at(np.array([0.9, 0.5, 0.1]))
    assert values == {"shot.material": "silicon_nitride", "shot.mass_g": 6.0,
                      "sonotrode.motion": "random_phase"}  # fmt: skip
    np.testing.assert_array_equal(space.point_of(values), [1.0, 0.5, 0.0])
    assert space.design_at(np.array([0.4, 0.5, 0.1])).shot.material == "zirconia"


def test_sizes_of_the_catalogue_are_written_into_the_study() -> None:
    name = "shot.diameter_mm"
    sizes = study({name: {"choose": "catalogue", "low": 1, "high": 3}}).vary[name].choose
    assert sizes == tuple(one for one in ball_sizes("steel") if 1 <= one <= 3)
    assert len(study({name: {"choose": "catalogue"}}).vary[name].choose) == len(ball_sizes("steel"))
    of_all = study({**VARY, name: {"choose": "catalogue"}}).vary[name].choose
    assert set(of_all) == set.intersection(*(set(ball_sizes(one)) for one in BEST))


LAW = {"C0": 0.9, "v0_m_s": 0.4}
OWN = GEAR.changed({"materials.wall": LAW})
HEAVY = GEAR.changed({
    "shot.material": None, "shot.density_kg_m3": 7000.0,
    **{f"materials.{name}": LAW for name in ("shot", "wall", "sonotrode")},
    "materials.part": {**LAW, "hardness_HB": 300.0},
})  # fmt: skip


@pytest.mark.parametrize(
    ("design", "name", "varied", "said"),
    [
        (GEAR, "shot.material", {"choose": ["steel", "zirkonia"]}, "did you mean 'zirconia'"),
        (GEAR, "shot.material", {"choose": ["zirconia", "silicon_nitride"]}, "starts at 'steel'"),
        (GEAR, "shot.material", {"choose": ["steel", "glass"]}, "cannot have shot.material = 'gl"),
        (GEAR, "shot.material", [1, 2], "it is a text; give { choose = "),
        (GEAR, "shot.material", {"choose": ["steel", 2]}, "of numbers, or of texts, not both"),
        (OWN, "shot.material", VARY["shot.material"], "materials.wall has numbers that are those"),
        (GEAR, "shot.mass_g", {"choose": ["a", "b"]}, "it is a number: give a list of numbers"),
        (GEAR, "chamber.shape", {"choose": ["box", "cylinder"]}, "vary what it lacks"),
        (GEAR, "shot.diameter_mm", {"choose": "catalogue", "low": 7.9}, "fewer than two sizes"),
        (GEAR, "shot.diameter_mm", {"choose": "catalogue", "low": math.nan}, "low: given nan"),
        (GEAR, "shot.mass_g", {"choose": "catalogue"}, "given 'catalogue'; allowed: a list"),
        (HEAVY, "shot.diameter_mm", {"choose": "catalogue"}, "which takes a shot.material"),
    ],
)
def test_mistakes(design: Design, name: str, varied: object, said: str) -> None:
    with pytest.raises(InputError) as caught:
        study({name: varied}, design)
    assert said in str(caught.value)


def test_balls_are_chosen_by_any_of_their_names() -> None:
    vary = {"shot.material": {"choose": ["Steel", "ZrO2"]}}
    assert study(vary).vary["shot.material"].texts == ("steel", "zirconia")


@pytest.mark.parametrize("value", ["glass", 3.0])
def test_a_candidate_to_begin_with_has_one_of_the_texts(value: object) -> None:
    first = {"shot.material": value, "shot.mass_g": 3.0}
    with pytest.raises(InputError, match=r"begin_with.0.shot.material: given .* none of the val"):
        study(begin_with=[first])
