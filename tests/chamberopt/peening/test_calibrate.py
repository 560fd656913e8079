"""Calibration of shops whose hidden parameters are known; known functions stand for simulations."""

import json
import math
import tomllib
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit

from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.calibration import Parameter, calibrated_strip
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design, save_design
from chamberopt.documents.calibration import calibration_end, calibration_lines
from chamberopt.peening.calibrate import Calibrated, calibrate, prepare
from chamberopt.peening.kirk_fit import heights
from chamberopt.peening.measured import Measured, load_measured
from chamberopt.peening.next_measurement import predict
from chamberopt.peening.posterior import TOGETHER, fit_surface
from chamberopt.peening.probes import ArcProbe, Impacts, PartProbe
from chamberopt.peening.setups import DropModel, Setup, exact_calibration
from chamberopt.peening.strip import StripSize, strip_cells
from chamberopt.printers import terminal
from chamberopt.workflows.calibrate import save_calibration
from tests.helpers.synthetic import plate_design


def smooth_plate() -> Design:
    """The shipped plate without friction, of which the known functions know nothing."""
    return plate_design().changed({"effects.friction": "none", "effects.roughness": "none"})


TRUTH: dict[Parameter, float] = {
    "amplitude": -0.08, "C0": 0.02, "v0": -0.6, "hardness": 0.15, "K": math.log(22.0), "beta": 0.3,
}  # fmt: skip
TIMES, PERCENT = (10.0, 20.0, 40.0, 80.0, 160.0), (0.05, 0.12)
DISC = strip_cells(StripSize(0.026, 0.026, is_disc=True))


def known_impacts(
    setup: Setup, values: Mapping[Parameter, float], executor: Executor, seed: int
) -> Impacts:
    """Faster and more impacts at more amplitude and restitution, in four replicas of 2 s."""
    design, rng = setup.design, np.random.default_rng(seed)
    calibration = exact_calibration(design, values)
    real = design.model_copy(update={"calibration": calibration}).simulated
    energy = math.exp(2.0 * values["C0"] + 0.1 * values["v0"])
    fastest = 0.2 * real.sonotrode.amplitude_um * energy
    count = 1200 * real.sonotrode.amplitude_um / 25.0 * energy
    mass = design.shot.ball_mass
    replicas = []
    for _ in range(4):
        n = rng.poisson(2.0 * count)
        speed = fastest * rng.uniform(0.3, 1.0, n)
        place = np.column_stack([rng.uniform(-0.013, 0.013, (n, 2)), np.zeros(n)])
        dent = dent_diameter(speed, 3e-3, design.shot.density, real.materials.part)
        triangle = rng.choice(np.flatnonzero(setup.target), n)
        columns = (speed, np.full(n, 80.0), dent, 0.5 * mass * speed**2)
        replicas.append(Hits(triangle.astype(np.int32), place.astype(np.float32),
                             *(one.astype(np.float32) for one in columns)))  # fmt: skip
    strip = calibrated_strip(design.shot, calibration)
    return Impacts(replicas, 2.0, design.shot.density, strip)


def shop(folder: Path, strips: bool = True, noise: float = 1.0) -> dict[str, Any]:
    """What a shop with the parameters TRUTH measures on the shipped plate."""
    rng = np.random.default_rng(5)
    save_design(smooth_plate(), folder / "plate.toml")
    design = smooth_plate()
    data: dict[str, Any] = {"design": "plate.toml"}
    for number, amplitude in enumerate((20.0, 30.0)):
        set_up = design.changed({"sonotrode.amplitude_um": amplitude})
        known = Setup(set_up, _chamber(), ("amplitude", "C0", "v0"))
        impacts = known_impacts(known, TRUTH, SerialExecutor(), 90 + number)
        arcs = ArcProbe(DISC, TIMES).read(impacts).at(TRUTH["beta"]) + TRUTH["K"]
        read = np.exp(arcs + 0.03 * noise * rng.normal(size=5)).tolist()
        if strips:
            data.setdefault("strip", []).append(
                {"amplitude_pv_um": 2.0 * amplitude, "time_s": list(TIMES), "arc_mm": read,
                 "disc_mm": 26.0}
            )  # fmt: skip
        if number:
            continue
        seen = PartProbe(("rate", "mean", "p90"), known.target, known.area).read(impacts).at(0.0)
        rate, mean, p90 = np.exp(seen + TRUTH["hardness"] * np.array([-0.5, -0.25, -0.25]))
        dents = {"mean": float(mean), "p90": float(p90), "count": 30}
        coverage = [
            {"time_s": time, "percent": 100.0 * -math.expm1(-rate * time)} for time in PERCENT
        ]
        data["coupon"] = [{"amplitude_um": amplitude, "coverage": coverage, "dent_mm": dents}]
    e = math.exp(DropModel(design.materials.part, 3.0)(TRUTH).values[0])
    data["drop"] = [{"surface": "part", "speed_m_s": 3.0, "restitution": e}]
    data["amplitude"] = {"set_pv_um": 50.0, "measured_pv_um": 50.0 * math.exp(-0.08)}
    return data


def _chamber() -> Any:
    from chamberopt.chamber.build import build_chamber

    return build_chamber(smooth_plate())


def calibrated(folder: Path, data: dict[str, Any]) -> Calibrated:
    path = folder / "measured.toml"
    path.write_text(tomlkit.dumps(data), encoding="utf-8")
    measured, designs = load_measured(path)
    prepared = prepare(measured, designs, folder)
    seeds: list[int] = []

    def counted(
        setup: Setup, values: Mapping[Parameter, float], by: Executor, seed: int
    ) -> Impacts:
        seeds.append(seed)
        return known_impacts(setup, values, by, seed)

    found = calibrate(measured, designs, prepared, SerialExecutor(), simulator=counted)
    assert found.runs == len(seeds)
    return found


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Calibrated:
    folder = tmp_path_factory.mktemp("shop")
    return calibrated(folder, shop(folder))


def test_errors_of_a_reading_hold_what_few_dents_leave_open() -> None:
    """Scatter among replicas, and the bound on the bias, both relative to the arc height."""
    setup = Setup(smooth_plate(), _chamber(), ("amplitude", "C0", "v0"))
    impacts = known_impacts(setup, TRUTH, SerialExecutor(), 90)
    found = heights(impacts.strip_dents(DISC), np.array(TIMES))
    scatter = [np.var(one.pseudovalues, ddof=1) / len(one.pseudovalues) for one in found]
    bias = [one.bias**2 for one in found]
    assert min(bias) > 0.0
    errors = (np.array(scatter) + bias) / np.square([one.value for one in found])
    noise = ArcProbe(DISC, TIMES).read(impacts).noise
    np.testing.assert_allclose(np.diag(noise), errors, rtol=1e-9)


def test_hidden_parameters_are_found_within_their_deviations(found: Calibrated) -> None:
    posterior = found.posterior
    sd = np.sqrt(np.diag(posterior.covariance))
    off = (posterior.mean - np.array([TRUTH[name] for name in posterior.prior.names])) / sd
    assert np.abs(off).max() < 2.5
    assert (sd < posterior.prior.sd).all()
    assert sd[posterior.prior.names.index("v0")] < 0.2  # the drop tells it
    assert sd[posterior.prior.names.index("K")] < 0.25
    assert found.moved < 0.5
    assert {one.error_scale for one in found.table.misfits} == {1.0}
    assert found.table.amplitude_um == (20.0, 30.0)  # not the design's own 25


def test_figures_of_the_design_are_predicted(found: Calibrated) -> None:
    truth = Setup(smooth_plate(), _chamber(), ("amplitude", "C0", "v0"))
    seen = [
        PartProbe(("rate",), truth.target, truth.area)
        .read(known_impacts(truth, TRUTH, SerialExecutor(), seed)).at(0.0)[0]
        for seed in range(20)
    ]  # fmt: skip
    rate = math.exp(np.mean(seen) - 0.5 * TRUTH["hardness"])
    by_name = {one.name: one for one in predict(found)}
    one = by_name["coverage_rate"]
    assert abs(math.log(one.value / rate)) < 2.5 * math.hypot(one.sd, one.noise)
    assert one.sd < 0.12 < one.sd_before
    assert by_name["intensity"].sd < 0.05
    assert by_name["saturation_time"].sd < 0.2


def test_the_result_is_a_machine_that_designs_can_name(found: Calibrated, tmp_path: Path) -> None:
    save_calibration(tmp_path, found)
    names = {one.name for one in tmp_path.iterdir()}
    assert names == {
        "calibration.json", "calibration.png", "calibration.txt", "design.toml", "machine.toml",
    }  # fmt: skip
    (tmp_path / "own.toml").write_text(
        'calibration = "machine.toml"\n' + _text(tmp_path, smooth_plate()), encoding="utf-8"
    )
    design = load_design(tmp_path / "own.toml")
    assert design.calibration == found.table
    assert design == load_design(tmp_path / "design.toml")
    data = json.loads((tmp_path / "calibration.json").read_text("utf-8"))
    assert data["parameters"]["K"]["log_sd"] < data["parameters"]["K"]["log_sd_before"]
    text = "\n".join(calibration_lines(found, predict(found)))
    assert "arc heights" in text
    assert "does not explain" not in text
    end = terminal.text(calibration_end(found, predict(found), verbose=False))
    assert end.startswith("The model explains what was measured; the Almen intensity of its design")
    assert "chi²" not in end
    assert "chi²" in terminal.text(calibration_end(found, predict(found), verbose=True))


def _text(folder: Path, design: Any) -> str:
    save_design(design, folder / "plain.toml")
    return (folder / "plain.toml").read_text("utf-8")


def test_without_strips_there_is_no_intensity_and_it_is_said(tmp_path: Path) -> None:
    data = shop(tmp_path, strips=False)
    found = calibrated(tmp_path, data)
    assert not found.table.has_strips
    assert {one.name for one in predict(found)} == {"coverage_rate"}
    assert "no intensity in mmA" in "\n".join(calibration_lines(found, predict(found)))


@pytest.mark.long
def test_what_the_model_cannot_explain_is_said_and_widens_intervals(
    found: Calibrated, tmp_path: Path
) -> None:
    """Arcs that saturate far too soon tell little, though a curve goes through their mean."""
    data = shop(tmp_path)
    for strip in data["strip"]:
        middle = strip["arc_mm"][2]
        strip["arc_mm"] = [middle * factor for factor in (0.97, 0.98, 1.0, 1.01, 0.99)]
    worse = calibrated(tmp_path, data)
    scales = {one.kind: one.error_scale for one in worse.table.misfits}
    assert scales["arc heights"] > 3.0
    assert chi2_per_freedom(worse, "arc heights") < 2.0
    fit, flat = ({one.name: one for one in predict(both)} for both in (found, worse))
    assert flat["intensity"].sd > 2.5 * fit["intensity"].sd
    assert flat["intensity"].next_sd > 2.0 * fit["intensity"].sd  # more strips are no better
    assert flat["saturation_time"].sd > fit["saturation_time"].sd
    text = "\n".join(calibration_lines(worse, predict(worse)))
    assert "does not explain your arc heights: their errors are taken" in text
    assert "strip.1 (60 µm peak to valley): the arc after 160 s is below an earlier one" in text
    end = terminal.text(calibration_end(worse, predict(worse), verbose=False))
    assert end.startswith("The model does not explain what was measured: arc heights")
    assert "does not explain your arc heights: their errors are taken" in end


def test_parameters_that_nobody_expects_widen_intervals_too(tmp_path: Path) -> None:
    """Arcs of one set that hardly rise take strips with many times the dents, and no misfit."""
    data = shop(tmp_path)
    strip = data["strip"][0]
    strip["arc_mm"] = [strip["arc_mm"][2] * factor for factor in (0.93, 0.97, 1.0, 1.02, 1.02)]
    worse = calibrated(tmp_path, {**data, "strip": [strip]})
    scales = {one.kind: one.error_scale for one in worse.table.misfits}
    assert scales["arc heights"] == 1.0
    assert scales[TOGETHER] > 1.2
    text = "\n".join(calibration_lines(worse, predict(worse)))
    assert "dents on strips is " in text
    assert "or give what you know as [prior] beta" in text


def chi2_per_freedom(found: Calibrated, kind: str) -> float:
    """chi² of a kind with its errors as they were taken, over a freedom that is surely there."""
    (one,) = (some for some in found.table.misfits if some.kind == kind)
    return one.chi2 / one.error_scale**2 / one.values


def test_a_surface_is_exact_for_straight_lines_and_averages_noise() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.3, 0.3, (40, 2))
    surface = fit_surface(places, np.zeros(2), 0.01)
    line = 2.0 + places @ [1.0, -2.0]
    here = np.array([0.1, 0.05])
    assert surface.weights(here) @ line == pytest.approx(2.0, abs=1e-4)
    errors = [surface.weights(here) @ rng.normal(0.0, 0.01, 40) for _ in range(500)]
    assert np.std(errors) <= 1.1 * 0.01 * math.sqrt(surface.noise(here))
    assert surface.noise(here) < 0.3


@pytest.mark.parametrize(
    ("speed", "expected"), [(0.1, 0.91 * 1.02), (3.0, 0.91 * 1.02 * (3.0 / (2 * 0.17)) ** -0.25)]
)  # fmt: skip
def test_a_drop_s_restitution_is_the_law_s(speed: float, expected: float) -> None:
    drop = DropModel(smooth_plate().materials.part, speed)
    found = drop({"C0": math.log(1.02), "v0": math.log(2.0)})
    assert math.exp(found.values[0]) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"strip": [{"time_s": [1, 2], "arc_mm": [0.1]}]}, "has 1 arcs for 2 times"),
        ({"strip": [{"time_s": [2, 1], "arc_mm": [0.1, 0.2]}]}, "give each time once, in order"),
        ({"strip": [{"time_s": [1, 2], "arc_mm": [110.0, 160.0]}]}, "above 0, to 3 mm"),
        ({"strip": [{"type": "N", "time_s": [1, 2], "arc_mm": [0.1, 0.2]}]}, "not supported"),
        ({"strip": [{"time_s": [1.0, 2.0], "arc_mm": [0.1, 0.2]}]}, "does not fit into"),
        (
            {"strip": [{"time_s": [1, 2], "arc_mm": [0.1, 0.2], "disc_mm": mm} for mm in (20, 40)]},
            "strip.1: a disc of 40 mm beside a disc of 20 mm: an arc height belongs to one size",
        ),
        (
            {"strip": [{"time_s": [1, 2, 4], "arc_mm": [0.1, 0.2, 0.15]}]},
            "strip.0.arc_mm.2: given 0.15 after 0.2, 6.8 standard deviations less",
        ),
        ({"coupon": [{"amplitude_um": 25.0}]}, "coupon.0.coverage: missing"),
        ({"coupon": [{"coverage": [{"time_s": 1, "percent": 100}]}]}, "given 100; allowed"),
        ({"drop": [{"surface": "floor", "speed_m_s": 1, "restitution": 0.8}]}, "given 'floor'"),
        ({"drop": [{"surface": "part", "speed_m_s": 1, "restitution": 1.2}]}, "given 1.2; allowed"),
        ({"prior": {"v1": {"sd_log": 0.3}}}, "prior.v1: unknown key; allowed here: amplitude"),
        ({"prior": {"mu": {"sd_log": 0.3}}}, "prior.mu: given, but no design here has"),
        ({"prior": {"K": {"sd_log": 0.3}}}, "prior.K: given, but no [[strip]] is given"),
        ({"amplitude": {"set_um": 25}}, "amplitude.set_um: unknown key"),
        ({"drop": []}, "holds no measurement"),
        ({"design": "gone.toml"}, "gone.toml: no such design file"),
    ],
)
def test_a_wrong_file_is_refused_before_any_work(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    save_design(smooth_plate(), tmp_path / "plate.toml")
    drop = {"surface": "part", "speed_m_s": 3.0, "restitution": 0.5}
    data = {"design": "plate.toml", "drop": [drop]} | change
    path = tmp_path / "measured.toml"
    path.write_text(tomlkit.dumps(data), encoding="utf-8")
    with pytest.raises(InputError) as error:
        prepare(*load_measured(path), tmp_path)
    assert message in str(error.value)


def test_the_example_of_the_docs_is_a_usable_file() -> None:
    page = (Path(__file__).parents[3] / "docs/how_to/calibrate.md").read_text(encoding="utf-8")
    example = page.split("```toml\n")[1]
    found = validate(Measured, tomllib.loads(example.split("```")[0]))
    assert len(found.strip[0].arc_mm) == 5
    assert found.prior.v0 is not None


def test_a_design_in_the_place_of_measurements_is_one_clear_error(tmp_path: Path) -> None:
    save_design(smooth_plate(), tmp_path / "plate.toml")
    with pytest.raises(InputError, match="this is a design file") as error:
        load_measured(tmp_path / "plate.toml")
    assert len(str(error.value).splitlines()) == 1


def test_shot_of_two_materials_is_refused(tmp_path: Path) -> None:
    save_design(smooth_plate(), tmp_path / "plate.toml")
    save_design(smooth_plate().changed({"shot.material": "zirconia"}), tmp_path / "zirconia.toml")
    drop = {"surface": "part", "speed_m_s": 3.0, "restitution": 0.5, "design": "zirconia.toml"}
    path = tmp_path / "measured.toml"
    path.write_text(tomlkit.dumps({"design": "plate.toml", "drop": [drop]}), encoding="utf-8")
    with pytest.raises(InputError, match="calibrate each on its own"):
        load_measured(path)
