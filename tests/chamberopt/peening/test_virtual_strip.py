"""What a virtual strip shows, with known impacts in the simulator's place and once with real ones.

Equal impacts, b of their dented area per area and second: H = K s (1 - exp(-beta b t)).
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.calibration import calibration_warnings
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import normal_quantile
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.strength import strip_dents
from chamberopt.design.calibration import NO_CALIBRATION, NO_STRIPS, TIME_ERROR
from chamberopt.design.load import load_design, save_design
from chamberopt.documents.terminal_lines import strip_end
from chamberopt.peening import virtual_strip
from chamberopt.peening.strip import StripSize, strip_cells
from chamberopt.peening.virtual_strip import VirtualStrip, peen_strip, strip_in_lid
from chamberopt.printers import terminal
from chamberopt.simulation.replicas import Replica, ReplicaSetting
from chamberopt.simulation.trapped_balls import NOT_TRAPPED
from tests.chamberopt.peening.test_strip import STRIP, hits_at, middles
from tests.helpers.synthetic import machine_values, plate_design

DISC = StripSize(40e-3, 40e-3, is_disc=True)
SHORT = plate_design(
    process__accuracy__simulated_time_s=0.3,
    process__accuracy__warmup_time_s=0.05,
    process__accuracy__replicas=3,
)
HITS = 100  # of each cell and replica
Z = normal_quantile(0.95)
MEANS = {"K": 13.0, "beta": 1.2}


def known(setting: ReplicaSetting, *_: object) -> list[Replica]:
    """So many more impacts as the amplitude is larger; their speed is the same."""
    design = setting.design
    more = design.simulated.sonotrode.amplitude_um / SHORT.sonotrode.amplitude_um
    hits = hits_at(middles(DISC, round(HITS * more)))
    return [Replica({}, None, NOT_TRAPPED, hits)] * design.process.accuracy.replicas


def peened(folder: Path, strip_type: Any = "A", **sds: float) -> VirtualStrip:
    """A strip of a design whose calibration knows these logarithms so well; K is 13, beta 1.2."""
    changes = {}
    if sds:
        logs = tuple(np.log(MEANS.get(name, 1.0)) for name in sds)
        changes = {"calibration": machine_values(**sds) | {"log_mean": logs}}
    setting = strip_in_lid(SHORT.changed(changes), strip_type, DISC, folder)
    return peen_strip(setting, build_chamber(setting.design), SerialExecutor())


def exact() -> tuple[float, float]:
    """S [µm] and T [s] before K and beta."""
    (dent,), (s,) = strip_dents(hits_at(np.zeros((1, 2))), SHORT.shot.density, STRIP)
    rate = HITS * np.pi / 4.0 * dent**2 / strip_cells(DISC).area[0] / SHORT.process.recorded_time
    return 0.9e6 * s, np.log(10.0) / rate


@pytest.fixture
def _known_impacts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(virtual_strip, "simulate_replicas", known)


@pytest.mark.usefixtures("_known_impacts")
def test_without_a_calibration_heights_are_strengths(tmp_path: Path) -> None:
    found = peened(tmp_path)
    strength, time = exact()
    assert found.unit == "µm"
    assert found.intensity.value == pytest.approx(strength)
    assert found.time.value == pytest.approx(time)
    assert found.at == pytest.approx(time * np.array([0.25, 0.5, 1.0, 2.0, 4.0]))
    heights = strength / 0.9 * (1.0 - 0.1 ** np.array([0.25, 0.5, 1.0, 2.0, 4.0]))
    assert [one.value for one in found.heights] == pytest.approx(heights.tolist())
    assert NO_CALIBRATION in found.notes
    assert "mmA" not in terminal.text(strip_end(found, [], verbose=True)).partition("note:")[0]


@pytest.mark.usefixtures("_known_impacts")
@pytest.mark.parametrize(("strip_type", "factor"), [("A", 1.0), ("N", 3.0), ("C", 1.0 / 3.5)])
def test_a_calibration_gives_millimetres_of_the_type(
    strip_type: str, factor: float, tmp_path: Path
) -> None:
    found = peened(tmp_path, strip_type, K=0.1, beta=0.2)
    strength, time = exact()
    height = 13e-3 * factor * strength
    assert found.unit == f"mm{strip_type}"
    assert found.intensity.value == pytest.approx(height)
    assert found.intensity.half_width == pytest.approx(0.1 * Z * height, rel=1e-3)
    assert found.time.value == pytest.approx(time / 1.2)
    of_time = np.hypot(0.2, TIME_ERROR)
    assert found.time.half_width == pytest.approx(of_time * Z * time / 1.2, rel=1e-3)
    assert found.at == pytest.approx(time / 1.2 * np.array([0.25, 0.5, 1.0, 2.0, 4.0]))
    early, x = found.heights[0], 0.25 * np.log(10.0)
    assert early.value == pytest.approx(height / 0.9 * -np.expm1(-x))
    by_beta = 0.2 * x * np.exp(-x) / -np.expm1(-x)
    assert early.half_width == pytest.approx(Z * early.value * np.hypot(0.1, by_beta), rel=1e-3)
    # This one has about 0.56 mmA.
    assert sum("where A strips are used" in note for note in found.notes) == (strip_type != "A")


@pytest.mark.usefixtures("_known_impacts")
def test_millimetres_of_discs_are_not_called_those_of_whole_strips(tmp_path: Path) -> None:
    design = SHORT.changed({"calibration": machine_values(K=0.1, beta=0.2)})
    for strips, unit in (("whole strip", "mmA"), ("disc of 26 mm", "mm")):
        one = design.changed({"calibration.strips": strips})
        setting = strip_in_lid(one, "A", DISC, tmp_path)
        found = peen_strip(setting, build_chamber(setting.design), SerialExecutor())
        assert found.unit == unit
        assert f"arc heights are those of a {strips}" in found.notes[0]
        assert any("not of a whole strip" in said.text for said in calibration_warnings(one)) == (
            unit == "mm"
        )


@pytest.mark.usefixtures("_known_impacts")
def test_what_a_simulation_must_show_of_a_calibration_is_in_the_interval(tmp_path: Path) -> None:
    """Impacts go with the amplitude: the time is as uncertain, the strength is not."""
    found = peened(tmp_path, amplitude=0.05)
    assert found.unit == "µm"
    assert NO_STRIPS in found.notes
    assert found.intensity.half_width == pytest.approx(0.0, abs=1e-6 * found.intensity.value)
    # over the step of 0.25 the slope of T is (exp(-0.25) - 1) / 0.25
    slope = -np.expm1(-0.25) / 0.25
    of_time = np.hypot(0.05 * slope, TIME_ERROR)
    assert found.time.half_width == pytest.approx(Z * of_time * found.time.value, rel=0.02)


def test_as_many_replicas_as_the_asked_accuracy_of_the_intensity_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Replicas differ by their speed: five times the accuracy takes far more of them."""
    simulated: list[int] = []

    def scattered(*given: Any) -> list[Replica]:
        simulated.extend(given[3])
        speed = 3.0 + 0.15 * np.random.default_rng(8).normal(size=1000)
        hits = [hits_at(middles(DISC, HITS), speed[number]) for number in given[3]]
        return [Replica({}, None, NOT_TRAPPED, one) for one in hits]

    monkeypatch.setattr(virtual_strip, "simulate_replicas", scattered)
    counts = []
    for asked, most in ((0.1, 400), (0.02, 400), (0.0001, 20)):
        simulated.clear()
        accuracy = {"objective_half_width": asked, "max_replicas": most}
        design = SHORT.changed({f"process.accuracy.{k}": one for k, one in accuracy.items()})
        folder = tmp_path / str(asked)
        folder.mkdir()
        setting = strip_in_lid(design, "A", DISC, folder)
        found = peen_strip(setting, build_chamber(setting.design), SerialExecutor())
        assert simulated == list(range(len(simulated)))  # each once, in order
        counts.append(len(simulated))
        reached = found.intensity.half_width <= asked * found.intensity.value
        assert reached == (most == 400)
        words = "was reached after" if reached else "was not reached"
        (note,) = (one for one in found.notes if "arc height at saturation" in one)
        assert f"the wanted accuracy of ± {asked:.3g} {words}" in note
    assert counts[0] < 20
    assert counts[1] > 2 * counts[0]
    assert counts[2] == 20


def test_a_shot_that_leaves_no_dent_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = Replica({}, None, NOT_TRAPPED, hits_at(middles(DISC, 3), 1.0))
    monkeypatch.setattr(virtual_strip, "simulate_replicas", lambda *_: [slow] * 3)
    with pytest.raises(
        InputError, match=r"no dent .*1 m/s, .*begin at 1\.2 m/s; raise the amplitude"
    ):
        peened(tmp_path)


def test_a_strip_that_is_covered_in_part_is_refused(tmp_path: Path) -> None:
    """A rod of 6 mm stands through the lid: it takes 2 % of a disc of 40 mm."""
    rod = {"kind": "rod", "diameter_mm": 6.0, "length_mm": 6.0, "at_mm": [0.0, 0.0, 13.0]}
    design = SHORT.changed({"chamber.deflectors": [rod]})
    setting = strip_in_lid(design, "A", DISC, tmp_path)
    with pytest.raises(InputError, match="98% of the strip face the shot; move the deflectors"):
        peen_strip(setting, build_chamber(setting.design), SerialExecutor())


def test_the_command_peens_a_strip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_design(SHORT, tmp_path / "plate.toml")
    out = tmp_path / "out"
    words = ["strip", str(tmp_path / "plate.toml"), "--disc-mm", "40", "--out", str(out)]
    assert main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert {one.name for one in out.iterdir()} == {
        "design.toml", "strip.json", "strip.csv", "strip.png", "strip_holder.obj",
    }  # fmt: skip
    assert (out / "strip.png").read_bytes().startswith(b"\x89PNG")
    assert len((out / "strip.csv").read_text("utf-8").splitlines()) == 6
    design = load_design(out / "design.toml")
    assert design.materials.part == STRIP
    assert (said["unit"], said["calibrated"], said["type"]) == ("µm", False, "A")
    assert 5.0 < said["intensity"]["value"] < 60.0
    heights = [row["arc_height"] for row in said["arc_heights"]]
    assert heights == sorted(heights)
    assert heights[3] == pytest.approx(1.1 * heights[2], rel=0.05)
    for fit in said["fits"].values():
        assert fit["intensity"] == pytest.approx(said["intensity"]["value"], rel=0.05)
        assert fit["saturation_time_s"] == pytest.approx(
            said["saturation_time_s"]["value"], rel=0.3
        )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("", "a strip of 76.2 x 19 mm does not fit"),
        ("--disc-mm 51", "there is room for --disc-mm 49.9"),
        ("--disc-mm 20 --size-mm 20 10", "--size-mm: given beside --disc-mm"),
        ("--disc-mm 0.5", "--disc-mm: given 0.5; allowed: from 2 to 2000 mm"),
        ("--size-mm 20 nan", "--size-mm: given nan"),
        ("--disc-mm 20 --distance-mm 2", "no ball fits under the part"),
        ("--disc-mm 20 --distance-mm 25", "--distance-mm: given 25; allowed"),
        ("--disc-mm 20 --at root", "--at: given 'root'"),
        ("--type B", "--type"),
    ],
)
def test_what_is_wrong_is_said_before_any_work(
    options: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_design(SHORT, tmp_path / "plate.toml")
    words = ["strip", str(tmp_path / "plate.toml"), *options.split()]
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


ZONE = {"name": "middle", "target": {"direction": [0.0, 0.0, -1.0], "angle_deg": [0.0, 10.0],
        "box_mm": [[-13.0, -13.0, -0.1], [13.0, 13.0, 0.1]]}}  # fmt: skip


def test_a_strip_in_the_place_of_a_zone_gets_its_impacts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The middle of the shipped plate; the part keeps its own metal."""
    design = SHORT.changed({"zones": [ZONE]})
    save_design(design, tmp_path / "plate.toml")
    out = tmp_path / "out"
    words = ["strip", str(tmp_path / "plate.toml"), "--at", "middle", "--type", "N"]
    assert main([*words, "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["place"] == "in the place of middle"
    assert 5.0 < said["intensity"]["value"] < 60.0
    assert load_design(out / "design.toml") == design
    assert main([*words, "--disc-mm", "20", "--out", str(tmp_path / "other")]) == 2
    assert "--disc-mm: given beside --at middle" in capsys.readouterr().err
    words[3] = "edge"
    assert main(words) == 2
    assert "--at: given 'edge'; allowed: lid, middle" in capsys.readouterr().err
