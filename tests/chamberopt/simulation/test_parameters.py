"""Every run of a convergence study has one numerical parameter off the reference."""

from chamberopt.simulation.numerical_parameters import (
    DRAG_STEP,
    GAUGE,
    MOTION,
    POINTS,
    TIME,
    numerical_parameters,
    study_designs,
)
from tests.helpers.synthetic import plate_design


def test_every_design_is_one_parameter_off_the_reference() -> None:
    own = plate_design()
    settings, designs = study_designs(own)
    (_, reference), *others = designs.items()
    assert others[-1][1] == own
    for (parameter, setting), design in others[:-1]:
        restored = design.changed({parameter: settings[parameter]})
        assert restored == reference != design
        assert setting
    assert settings[MOTION] == "sinusoidal"
    assert settings[TIME] == own.process.accuracy.simulated_time_s


def test_what_is_left_out_stays_as_designed() -> None:
    own = plate_design()
    settings, designs = study_designs(own, [MOTION, POINTS])
    assert settings[MOTION] == own.sonotrode.motion
    assert not {MOTION, POINTS} & {parameter for parameter, _ in designs}
    assert len(designs) == len(study_designs(own)[1]) - 3


def test_a_value_at_its_limit_is_tried_once() -> None:
    few = plate_design(process__accuracy__points=1_000)
    assert [setting for name, setting in study_designs(few)[1] if name == POINTS] == ["2000"]


def test_drag_adds_its_step() -> None:
    own = plate_design()
    assert DRAG_STEP not in numerical_parameters(own)
    effects = own.effects.model_copy(update={"drag": True})
    with_drag = numerical_parameters(own.model_copy(update={"effects": effects}))
    assert with_drag[DRAG_STEP] == (40.0, 10.0, 2.5)


def test_gauge_and_points_are_tried_wider_and_in_other_numbers() -> None:
    found = numerical_parameters(plate_design())
    assert found[GAUGE] == (4.0, 1.0)
    assert found[POINTS] == (5_000, 40_000, 20_000)
    most = plate_design(process__accuracy__points=1_000_000, process__accuracy__gauge_mm2=1e4)
    at_limits = numerical_parameters(most)
    assert at_limits[GAUGE] == (1e4, 1e4)
    assert at_limits[POINTS] == (250_000, 1_000_000, 1_000_000)
    few = plate_design(process__accuracy__points=1_000)
    assert numerical_parameters(few)[POINTS] == (1_000, 2_000, 1_000)
