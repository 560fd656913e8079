"""Every run of a convergence study has one numerical parameter off the reference."""

from chamberopt.simulation.convergence.parameters import (
    DRAG_STEP,
    MOTION,
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


def test_drag_adds_its_step() -> None:
    own = plate_design()
    assert DRAG_STEP not in numerical_parameters(own)
    effects = own.effects.model_copy(update={"drag": True})
    with_drag = numerical_parameters(own.model_copy(update={"effects": effects}))
    assert with_drag[DRAG_STEP] == (40.0, 10.0, 2.5)
