"""A calibration: its table, the design that is simulated with it, and where it does not hold."""

import math
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit

from chamberopt.chamber.checks.calibration import calibration_warnings
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.common.errors import InputError
from chamberopt.coverage.metrics import metric_problem
from chamberopt.design.calibration import calibrated_strip
from chamberopt.design.design import validate
from chamberopt.design.load import Design, load_design, save_design
from tests.helpers.synthetic import machine_values, plate_design

ALL = machine_values(amplitude=0.05, C0=0.02, v0=0.3, mu=0.1, hardness=0.1, K=0.12, beta=0.1)
MEANS = {"amplitude": -0.1, "C0": -0.05, "v0": 0.4, "mu": 0.3, "hardness": 0.2, "K": 2.6}
ALL["log_mean"] = tuple(MEANS.get(name, 0.0) for name in ALL["parameters"])


def calibrated(**changes: Any) -> Design:
    return plate_design(calibration={**ALL, **changes})


def test_a_design_names_the_file_and_holds_its_numbers(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(tomlkit.dumps(ALL), encoding="utf-8")
    own = tmp_path / "own.toml"
    save_design(plate_design(), own)
    named = tmp_path / "named.toml"
    named.write_text('calibration = "machine.toml"\n' + own.read_text("utf-8"), encoding="utf-8")
    design = load_design(named)
    assert design == calibrated()
    (tmp_path / "machine.toml").unlink()
    save_design(design, tmp_path / "whole.toml")
    assert load_design(tmp_path / "whole.toml") == design
    assert pickle.loads(pickle.dumps(design)) == design
    assert not [name for name in design.numbers() if name.startswith("calibration")]


def test_measured_values_take_the_place_of_the_design_s() -> None:
    design = calibrated().changed({"effects.friction": {"mu": 0.3, "beta0": 0.2}})
    found, metal = design.simulated, design.simulated.materials
    assert found.sonotrode.amplitude_um == pytest.approx(25.0 * math.exp(-0.1))
    assert pytest.approx(0.91 * math.exp(-0.05)) == metal.wall.C0
    assert metal.part.v0_m_s == pytest.approx(0.17 * math.exp(0.4))
    assert metal.part.hardness_HB == pytest.approx(120 * math.exp(0.2))
    assert found.effects.friction is not None
    assert found.effects.friction.mu == pytest.approx(0.3 * math.exp(0.3))
    assert found.effects.friction.mu_balls is None
    assert found.simulated == found  # values are never put in twice
    assert plate_design().simulated == plate_design()
    shot = design.shot
    strip, plain = calibrated_strip(shot, design.calibration), calibrated_strip(shot, None)
    assert strip.hardness_HB == plain.hardness_HB  # that of a strip is known
    assert strip.v0_m_s == pytest.approx(plain.v0_m_s * math.exp(0.4))  # type: ignore[operator]


def test_no_restitution_is_above_one() -> None:
    one = machine_values(C0=0.02)
    table = {"e_at_m_s": [[0.1, 0.93], [5, 0.6]], "v0_m_s": 0.2, "hardness_HB": 120.0}
    design = plate_design(calibration={**one, "log_mean": (0.11,)})
    assert design.simulated.materials.wall.C0 == 1.0
    tabled = design.changed({"materials.part": table}).simulated.materials.part
    assert tabled.e_at_m_s == ((0.1, 1.0), (5.0, pytest.approx(0.6 * math.exp(0.11))))


@pytest.mark.parametrize(
    ("name", "log_mean", "message"),
    [
        ("C0", 0.3, "its C0 makes materials.wall.C0 1.23; allowed: to 1; correct log_mean, or"),
        ("amplitude", 4.0, "sonotrode.amplitude_um would be out of range: given 1364.95"),
        ("hardness", 3.0, "materials.part.hardness_HB would be out of range: given 2410.26"),
    ],
)
def test_a_machine_whose_values_no_design_may_have_is_refused(
    name: str, log_mean: float, message: str
) -> None:
    with pytest.raises(InputError) as error:
        plate_design(calibration=machine_values(**{name: 0.02}) | {"log_mean": (log_mean,)})
    assert all(line.startswith("calibration: ") for line in str(error.value).splitlines())
    assert message in str(error.value)


def test_errors_are_independent_and_of_the_right_size() -> None:
    spread = np.array([[0.04, 0.03, 0.0], [0.03, 0.09, 0.0], [0.0, 0.0, 0.0]])
    one = machine_values(K=1.0, v0=1.0, beta=0.0)
    one["log_covariance"] = tuple(map(tuple, spread.tolist()))
    found = plate_design(calibration=one).calibration
    assert found is not None
    slopes = np.array([1.0, -2.0, 5.0])
    errors = found.errors(dict(zip(("K", "v0", "beta"), slopes, strict=True)))
    assert math.hypot(*errors) == pytest.approx(math.sqrt(slopes @ spread @ slopes), rel=1e-4)
    assert len(errors) == len(found.errors({})) == 8
    assert found.errors({}, of_model=3.0)[-1] == 3.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"log_mean": (0.1,)}, "log_mean: has 1 numbers for 7 parameters"),
        ({"log_covariance": ((1.0,),)}, "log_covariance: is not 7 rows of 7 numbers"),
        ({"parameters": ("K", "K", *ALL["parameters"][2:])}, "name each once"),
        ({"parameters": ("volume", *ALL["parameters"][1:])}, "given 'volume'"),
        ({"amplitude_um": (30.0, 20.0)}, "amplitude_um: given [30, 20]"),
        ({"log_mean": (50.0, *ALL["log_mean"][1:])}, "log_mean: given 50; allowed: -10 to 10"),
        ({"more": 1}, "more: unknown key"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        calibrated(**changes)


def test_a_matrix_that_is_no_covariance_is_refused() -> None:
    one = machine_values(C0=0.1, v0=0.1)
    for rows, what in (
        (((0.01, 0.02), (0.0, 0.01)), "not symmetric"),
        (((0.01, 0.02), (0.02, 0.01)), "not positive semi-definite"),
    ):
        with pytest.raises(InputError, match=what):
            plate_design(calibration={**one, "log_covariance": rows})
    with pytest.raises(InputError, match="one of K and beta"):
        plate_design(calibration=machine_values(K=0.1))


def test_a_file_that_is_no_calibration_is_one_clear_error(tmp_path: Path) -> None:
    save_design(plate_design(), tmp_path / "own.toml")
    text = (tmp_path / "own.toml").read_text("utf-8")
    for name, message in (("own.toml", "holds no calibration; make one with chamberopt calibrate"),
                          ("gone.toml", "no such calibration file")):  # fmt: skip
        path = tmp_path / "design.toml"
        path.write_text(f'calibration = "{name}"\n{text}', encoding="utf-8")
        with pytest.raises(InputError, match=message) as error:
            load_design(path)
        assert len(str(error.value).splitlines()) == 1


def test_a_result_that_names_a_file_is_refused(tmp_path: Path) -> None:
    data = plate_design().model_dump() | {"calibration": str(tmp_path / "machine.toml")}
    with pytest.raises(InputError, match="in a result; simulate again"):
        validate(Design, data, recorded=True)


def test_there_is_no_intensity_without_measured_strips() -> None:
    assert "takes a calibration" in metric_problem(plate_design(), "almen_intensity")
    without = plate_design(calibration=machine_values(v0=0.1))
    assert "no arc heights" in metric_problem(without, "almen_intensity_p05")
    assert metric_problem(calibrated(), "almen_intensity") == ""


def test_what_is_outside_the_calibration_is_said() -> None:
    assert calibration_warnings(plate_design()) == []
    assert calibration_warnings(calibrated()) == []
    misfit = {"kind": "dents", "chi2": 30.0, "values": 4, "error_scale": 2.7}
    far = calibrated(misfits=(misfit,)).changed(
        {"sonotrode.amplitude_um": 40.0, "shot.diameter_mm": 1.5, "shot.material": "zirconia"}
    )
    found = calibration_warnings(far)
    assert len(found) == 4
    for one, word in zip(found, ("40", "1.5 mm", "another material", "dents"), strict=True):
        assert word in one.text
    assert {one.kind for one in found} == {WarningKind.CALIBRATION}
    assert len({one.subject for one in found}) == 4
    without = plate_design(calibration=machine_values(v0=1.0))
    assert any("no arc heights" in one.text for one in calibration_warnings(without))


def test_friction_in_only_one_of_design_and_calibration_is_said() -> None:
    """Restitution that was fitted without friction stands for what friction takes as well."""
    without, fitted = machine_values(v0=0.1), machine_values(v0=0.1, mu=0.1)
    for own, calibration, word in (("catalogue", without, "counts it twice"),
                                   ("none", fitted, "too fast"),
                                   ("catalogue", fitted, ""), ("none", without, "")):  # fmt: skip
        design = plate_design(calibration=calibration, effects__friction=own)
        found = [one for one in calibration_warnings(design) if one.about == ("friction",)]
        assert len(found) == (1 if word else 0)
        assert all(word in one.text for one in found)
