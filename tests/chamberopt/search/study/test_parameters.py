"""What a parameter may be: its values, its rounding, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.search.study import Study, load_study
from chamberopt.search.study.parameters import ParameterSpace, Varied, bound_at
from tests.helpers.known_optima import GEAR
from tests.helpers.synthetic import DESIGNS

PRISM = GEAR.changed({"chamber": {"shape": "prism", "sides": 6, "across_mm": 60.0,
                                  "height_mm": 45.0, "sonotrode_distance_mm": 15.0}})  # fmt: skip
VARY = {
    "chamber.height_mm": (28, 60),
    "sonotrode.amplitude_um": {"low": 20, "high": 60, "step": 5},
    "shot.diameter_mm": {"choose": [2.0, 1.5, 4.0]},
    "chamber.sides": (4, 8),
}


def test_values_are_those_of_the_file() -> None:
    space = ParameterSpace(PRISM, Study(design=PRISM, vary=VARY).vary)
    assert [axis.levels for axis in space.domain.axes] == [0, 9, 3, 5]
    values = space.values_at(np.array([0.123456, 0.51, 0.9, 0.3]))
    assert values == {
        "chamber.height_mm": 31.95,  # three digits of the width of its bounds
        "sonotrode.amplitude_um": 40.0,
        "shot.diameter_mm": 4.0,
        "chamber.sides": 5.0,
    }
    design = space.design_at(np.array([0.123456, 0.51, 0.9, 0.3]))
    assert design.chamber.sides == 5
    assert space.values_at(space.start) == {name: PRISM.value(name) for name in VARY}
    np.testing.assert_allclose(space.point_of(values), [0.1234375, 0.5, 1.0, 0.25])
    np.testing.assert_allclose(space.values_on(2, np.array([0.0, 0.25, 1.0])), [1.5, 1.75, 4.0])


@pytest.mark.parametrize("bounds", [(3, 8), (3, 13), (4, 9), (4, 14), (5, 10)])
def test_a_level_is_itself_again_after_the_way_through_the_unit_cube(
    bounds: tuple[int, int],
) -> None:
    """Interpolated, 7 sides of 4 to 9 were 6.999999999999999, and simulated as 6."""
    space = ParameterSpace(PRISM, Study(design=PRISM, vary={"chamber.sides": bounds}).vary)
    for sides in range(bounds[0], bounds[1] + 1):
        point = space.point_of({"chamber.sides": float(sides)})
        assert space.values_at(point) == {"chamber.sides": sides}
        assert space.design_at(point).chamber.sides == sides


@pytest.mark.parametrize("value", [2.381, 3.2, 3.969])
def test_a_catalogue_size_is_as_it_is_sold(value: float) -> None:
    sizes = sorted({1.5, 1.588, 2.0, 2.381, 2.5, 3.0, 3.2, 3.969, 4.0})
    vary = Study(design=GEAR, vary={"shot.diameter_mm": {"choose": sizes}}).vary
    space = ParameterSpace(GEAR, vary)
    point = space.point_of({"shot.diameter_mm": value})
    assert space.values_at(point) == {"shot.diameter_mm": value}


def test_a_key_given_in_quotes_and_without_is_given_twice(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    text = f'design = "{DESIGNS / "gear.toml"}"\n[vary]\nchamber.height_mm = [30, 50]\n'
    file.write_text(f'{text}"chamber.height_mm" = [35, 50]\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"study\.toml: chamber\.height_mm is given twice"):
        load_study(file)


def test_a_study_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    import tomlkit

    study = Study(design=PRISM, vary=VARY)
    said = study.model_dump(mode="json")["vary"]
    assert said["chamber.height_mm"] == [28.0, 60.0]
    assert said["shot.diameter_mm"] == {"choose": [2.0, 1.5, 4.0]}
    assert Study(design=PRISM, vary=said) == study
    file = tmp_path / "study.toml"
    gear = {name: said[name] for name in VARY if name != "chamber.sides"}
    text = tomlkit.dumps({"design": str(DESIGNS / "gear.toml"), "vary": gear})
    file.write_text(text, encoding="utf-8")
    assert load_study(file).vary == Study(design=GEAR, vary=gear).vary


@pytest.mark.parametrize(
    ("varied", "said"),
    [
        ({"low": 20, "high": 60, "step": 7}, "starts at 40, which is none of its values"),
        ({"low": 20, "high": 60, "step": 50}, r"step: given 50; give a step that fits"),
        ({"low": 20, "high": 60, "step": 0}, r"step: given 0; give a step that fits"),
        ({"low": 20, "high": 60, "step": 1e-12}, r"step: given 1e-12; give a step that fits"),
        ({"low": -1e308, "high": 1e308, "step": 1e-300}, "give a step that fits"),
        ({"low": 60, "high": 20}, "low must be below high"),
        ({"low": 20}, "give both low and high"),
        ({"choose": [40]}, "two different values"),
        ({"choose": [40, 50], "low": 20}, "low and high, or choose"),
        ({"choose": [30, 50]}, "none of its values"),
        ({"low": 20, "high": 60, "stap": 5}, "did you mean 'step'"),
        ([20, 60, 5], r"allowed: \[low, high\]"),
        ({"choose": ["a", "b"]}, "a list of numbers"),
    ],
)
def test_what_makes_no_sense_is_refused(varied: object, said: str) -> None:
    amplitude = GEAR.changed({"sonotrode.amplitude_um": 40.0})
    with pytest.raises(InputError, match=said):
        make_study({"sonotrode.amplitude_um": varied}, amplitude)


def test_the_last_step_is_the_upper_bound() -> None:
    study = make_study({"chamber.height_mm": {"low": 31, "high": 60, "step": 7}}, GEAR)
    assert study.vary["chamber.height_mm"].bounds == (31.0, 59.0)


def test_the_start_is_the_point_of_its_values() -> None:
    vary = {"chamber.height_mm": {"low": 39, "high": 46, "step": 1}}  # at 45: 6/7, not 6 (1/7)
    space = ParameterSpace(GEAR, Study(design=GEAR, vary=vary).vary)
    assert np.array_equal(space.start, space.domain.snap(np.array([[0.86]]))[0])


def test_a_whole_number_has_whole_values_and_settings_do_not_vary() -> None:
    with pytest.raises(InputError, match="give fewer than 1000 values"):
        make_study({"chamber.sides": (4, 1e300)}, PRISM)
    with pytest.raises(InputError, match="it is a whole number"):
        make_study({"chamber.sides": {"low": 4, "high": 8, "step": 0.5}}, PRISM)
    with pytest.raises(InputError, match="a whole number cannot vary"):
        make_study({"process.seed": (1, 4)}, GEAR)


def test_a_tolerance_in_percent_is_of_the_value_that_is_aimed_at() -> None:
    tolerances = {"shot.mass_g": ["-10 %", "0 %"], "chamber.height_mm": 0.8}
    vary = {"chamber.height_mm": (30.0, 60.0), "shot.mass_g": (2.0, 10.0)}
    design = GEAR.changed({"tolerances": tolerances})
    space = ParameterSpace(design, Study(design=design, vary=vary).vary)
    around = space.domain.around(np.array([[0.0, 0.0], [0.5, 1.0]]))
    height, mass = np.moveaxis(around - [[0.0, 0.0], [0.5, 1.0]], 2, 0)
    np.testing.assert_allclose(height.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(height).max(axis=0), 0.8 / 30 * 15 / 16)
    np.testing.assert_allclose(mass.mean(axis=0), [-0.1 / 8, -0.5 / 8])  # of 2 g and of 10 g


def test_designs_to_begin_with_are_values_within_the_bounds() -> None:
    vary = {"chamber.height_mm": (28, 60), "shot.mass_g": (2, 10)}
    study = Study(design=GEAR, vary=vary, begin_with=[str(DESIGNS / "gear.toml")])
    assert study.begin_with == ({name: GEAR.value(name) for name in vary},)
    for given, said in (
        ({"shot.mass_g": 4.0}, "has shot.mass_g; give chamber.height_mm, shot.mass_g"),
        ({"shot.mass_g": 40.0, "chamber.height_mm": 30.0}, "40 is outside"),
        ("nowhere.toml", "nowhere.toml"),
    ):
        with pytest.raises(InputError, match=said):
            make_study(vary, GEAR, begin_with=[given])


def test_a_budget_holds_the_start_and_the_designs_to_begin_with() -> None:
    first = [{"shot.mass_g": 4.0}, {"shot.mass_g": 6.0}]
    with pytest.raises(InputError, match="too few for the start and those of begin_with; give 3"):
        make_study({"shot.mass_g": (2, 10)}, GEAR, begin_with=first, optimizer={"evaluations": 2})


def test_designs_to_begin_with_are_beside_the_study_also_where_its_design_is_wrong(
    tmp_path: Path,
) -> None:
    (tmp_path / "gear.toml").write_bytes((DESIGNS / "gear.toml").read_bytes())
    file = tmp_path / "study.toml"
    file.write_text(
        'design = "no.toml"\nbegin_with = ["gaer.toml"]\n[vary]\n"shot.mass_g" = [2, 9]'
    )
    with pytest.raises(InputError) as caught:
        load_study(file)
    assert f"did you mean {tmp_path / 'gear.toml'}" in str(caught.value)


def make_study(vary: object, design: object, **tables: object) -> Study:
    from chamberopt.design.design import validate

    return validate(Study, {"design": design, "vary": vary, **tables})


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_step_fits_once_or_more_and_makes_no_more_than_a_thousand_values(unit: float) -> None:
    for count in (1, 2, 999):
        one = Varied(low=0.0, high=unit * count, step=unit)
        assert len(one.values(is_whole=False)) == count + 1
    for count in (0.9, 1000):
        with pytest.raises(ValueError, match="give a step that fits 1 to 999 times"):
            Varied(low=0.0, high=unit * count, step=unit)
    assert Varied(low=0.0, high=0.3 * unit, step=(0.1 + 0.2) * unit)  # wider by rounding alone


def test_a_number_is_at_a_bound_up_to_a_thousandth_of_their_distance() -> None:
    ends = (20.0, 60.0)
    for away, said in ((0.0, True), (0.039, True), (0.041, False)):
        assert bound_at(20.0 + away, ends) == ("lower" if said else "")
        assert bound_at(60.0 - away, ends) == ("upper" if said else "")
    assert bound_at("box", ("box", "prism")) == ""
