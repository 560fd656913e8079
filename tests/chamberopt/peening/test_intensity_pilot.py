"""The pilot of an intensity: a short run that tells what a long one shows."""

import math

import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import Design
from chamberopt.peening.intensity_pilot import predict_intensity
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from tests.helpers.synthetic import machine_values, plate_design

USUAL_K = 13.5e-3  # mmA per µm


@pytest.fixture(scope="module")
def design() -> Design:
    return plate_design()


@pytest.mark.parametrize("factor", [1.0, 1.4])
def test_the_band_of_a_pilot_holds_the_strength_of_a_longer_run(
    design: Design, factor: float
) -> None:
    amplitude = factor * design.sonotrode.zero_to_peak_um
    louder = design.changed({"sonotrode.amplitude_um": amplitude})
    chamber, executor = build_chamber(louder), SerialExecutor()
    pilot = predict_intensity(louder, chamber, executor)
    assert pilot is not None
    accuracy = {"simulated_time_s": 2.0, "gauge_mm2": 2.0, "objective_half_width": None}
    longer = louder.changed({f"process.accuracy.{key}": x for key, x in accuracy.items()})
    found = evaluate(longer, chamber, executor, plan=ReplicaPlan(count=8))
    strength = found.metrics["strength_um"]
    assert not strength.in_words
    # Of the strength alone: the band of its constant, a factor of 2.46, taken out.
    sd = math.sqrt(math.log(pilot.predicted.factor) ** 2 - 0.9**2)
    off = abs(math.log(pilot.predicted.value / (USUAL_K * strength.value)))
    assert off <= 1.96 * sd + strength.half_width / strength.value
    assert sd < 0.15


def test_a_calibration_takes_the_place_of_the_usual_constant(design: Design) -> None:
    measured = machine_values(amplitude=0.03, K=0.05, beta=0.1)
    calibrated = design.changed({"calibration": measured})
    chamber, executor = build_chamber(design), SerialExecutor()
    bare, pilot = (predict_intensity(one, chamber, executor) for one in (design, calibrated))
    assert bare is not None
    assert pilot is not None
    found = pilot.predicted
    assert found.factor == 1.0
    assert found.value == pytest.approx(1e-3 / USUAL_K * bare.predicted.value)  # K = 1
    half = 0.5 * (found.high - found.low) / found.value
    assert half > 1.96 * 0.05  # at least what K leaves open
