"""Balls and amplitudes for a wanted intensity, on machines whose law is known."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import trimesh

from chamberopt.chamber.layout.balls import SizeFit, larger_sizes, serving_sizes
from chamberopt.chamber.propose import proposed_intensity
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Proposal, Wanted
from chamberopt.chamber.propose.proposed_budget import Asked, Measured, propose_budget
from chamberopt.chamber.propose.proposed_intensity import (
    INTENSITY,
    LARGER,
    MOST_PILOTS,
    Compared,
    IntensityPilot,
    as_no_wish,
    is_off,
    larger_balls,
    larger_instead,
    of_ball_sizes,
    propose_intensity,
    settings_beside,
    usual_for,
    with_expected_intensity,
    with_thin_places,
    with_usual_intensity,
)
from chamberopt.chamber.propose.proposed_setting import (
    AMPLITUDE_POWER,
    BALL_POWER,
    Setting,
    Settings,
    choose,
    expected_intensity,
    setting_of,
    settings_of,
)
from chamberopt.chamber.propose.text import clauses, design_text, study_texts
from chamberopt.chamber.shop import Shop, load_shop
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.design.design import validate
from chamberopt.design.intensity import PredictedIntensity, WantedIntensity
from chamberopt.design.load import load_design
from chamberopt.search.study import load_study

BALLS, AMPLITUDES = (1.0, 1.5, 2.0, 3.0), (20.0, 25.0, 30.0, 40.0)
SETTINGS = [Setting(ball, amplitude) for ball in BALLS for amplitude in AMPLITUDES]


def fit(diameter_mm: float, **changed: Any) -> SizeFit:
    return replace(SizeFit(1e-3 * diameter_mm, 0.98, 0.95, True, 0.0, 500), **changed)


def test_the_law_goes_with_the_ball_and_nearly_with_the_amplitude() -> None:
    simulated = {Setting(2.0, 30.0): 0.20}
    assert expected_intensity(Setting(2.0, 30.0), simulated) == 0.20
    assert expected_intensity(Setting(3.0, 30.0), simulated) == pytest.approx(0.30)
    lower = expected_intensity(Setting(2.0, 20.0), simulated)
    assert lower == pytest.approx(0.20 * (2.0 / 3.0) ** AMPLITUDE_POWER)
    nearer = simulated | {Setting(3.0, 25.0): 0.40}
    assert expected_intensity(Setting(3.0, 20.0), nearer) == pytest.approx(0.40 * 0.8**0.9)


def test_of_settings_in_the_middle_the_largest_amplitude_is_chosen() -> None:
    """With I = D A / 200 mmA both 2 mm at 20 µm and 1 mm at 40 µm give 0.2 mmA."""
    simulated = {one: one.ball_mm * one.amplitude_um / 200.0 for one in SETTINGS}
    assert choose(WantedIntensity(0.15, 0.25), SETTINGS, simulated) == Setting(1.0, 40.0)
    # 0.29 mmA lie at the edge of this range, 0.3 mmA in its middle.
    assert choose(WantedIntensity(0.28, 0.32), SETTINGS, simulated) == Setting(1.5, 40.0)


def test_in_the_range_balls_that_serve_more_are_chosen() -> None:
    """Though they give an intensity at its edge. What serves hardly more does not count."""
    simulated = {one: one.ball_mm * one.amplitude_um / 200.0 for one in SETTINGS}
    wanted = WantedIntensity(0.2, 0.32)
    assert choose(wanted, SETTINGS, simulated).ball_mm == 1.5
    for gain, ball in ((0.05, 1.0), (0.005, 1.5)):
        served = {one.ball_mm: 0.8 + gain * (one.ball_mm < 1.5) for one in SETTINGS}
        assert choose(wanted, SETTINGS, simulated, served).ball_mm == ball
    too_strong = WantedIntensity(0.5, 0.6)
    assert choose(too_strong, SETTINGS, simulated, {1.0: 1.0, 3.0: 0.5}).ball_mm > 2.0


@pytest.mark.parametrize(
    ("wanted", "nearest"), [((0.8, 0.9), Setting(3.0, 40.0)), ((0.03, 0.05), Setting(1.0, 20.0))]
)
def test_where_none_gives_it_the_nearest_is_chosen(
    wanted: tuple[float, float], nearest: Setting
) -> None:
    simulated = {one: one.ball_mm * one.amplitude_um / 200.0 for one in SETTINGS}
    assert choose(WantedIntensity(*wanted), SETTINGS, simulated) == nearest


def test_balls_that_serve_less_or_jam_or_are_too_many_are_not_tried() -> None:
    fits = [fit(0.5, count=9000), fit(1), fit(1.5, jam=1.5e-3), fit(2), fit(3, served=0.5)]
    fits = [replace(one, suits=one.served > 0.9) for one in fits]
    assert serving_sizes(fits) == [1e-3, 2e-3]
    more = [fit(2.2, served=0.92, suits=False), fit(2.5, served=0.92, jam=2.5e-3)]
    far = replace(fit(2.8, served=0.5), suits=False)  # in a wide fillet, which they touch
    short = [replace(far, touched=0.9), replace(far, fillets=0.9), replace(far, nearly_jam=2.8e-3)]
    for one in (far, *short):
        expected = [more[0], far] if one is far else more[:1]
        assert larger_sizes([*fits[:-1], *more, one]) == expected


@dataclass
class Machine:
    """A machine with I = level D^p A^q [mmA, mm, µm], and the pilots that were run on it."""

    level: float
    p: float = 1.0
    q: float = 0.9
    pilots: int = 0

    def simulate(self, made: Proposal) -> IntensityPilot | None:
        self.pilots += 1
        one = setting_of(made)
        value = self.level * one.ball_mm**self.p * one.amplitude_um**self.q
        predicted = PredictedIntensity.estimated(Estimate(value / 13.5e-3, 0.0))
        return None if predicted is None else IntensityPilot(predicted, 100.0)


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plate") / "plate.stl"
    trimesh.creation.box((40, 40, 8)).export(path)
    return path


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    path = tmp_path_factory.mktemp("shop") / "shop.toml"
    path.write_text(
        '[[sonotrodes]]\nname = "one"\ndiameter_mm = 70\nfrequency_khz = 20\n'
        "amplitudes_pv_um = [40, 50, 60, 80]\n"
        '[[balls]]\nmaterial = "steel"\ndiameters_mm = [1, 1.5, 2, 3]\n'
    )
    return load_shop(path)


@pytest.mark.parametrize(
    ("machine", "given"),
    [
        ((2.0e-3, 1.0, 0.9), "0.20-0.25A"),
        ((2.0e-3, 1.0, 0.5), "0.10-0.15A"),
        ((2.0e-3, 1.0, 0.5), "0.35-0.45A"),
        ((1.2e-3, 1.3, 1.0), "0.10-0.15A"),
    ],
)
def test_machines_of_other_laws_are_found_by_pilots(
    plate: Path, shop: Shop, given: str, machine: tuple[float, float, float]
) -> None:
    wanted, intensity, law = (
        Wanted("mm", shop=shop),
        WantedIntensity.parse(given),
        Machine(*machine),
    )
    bare = propose(plate, wanted, lambda _: [])

    def again(other: Wanted) -> Proposal:
        return propose(plate, other, lambda _: [])

    made = propose_intensity(bare, wanted, intensity, again, law.simulate)
    assert 1 <= law.pilots <= MOST_PILOTS
    one = setting_of(made)
    possible = [*settings_of(bare, wanted).serving, *settings_of(bare, wanted).larger]
    assert one in possible  # of the shop's balls and its amplitudes
    assert made.tables["sonotrode"]["amplitude_pv_um"] == 2.0 * one.amplitude_um
    value = law.level * one.ball_mm**law.p * one.amplitude_um**law.q
    reach = [law.level * x.ball_mm**law.p * x.amplitude_um**law.q for x in possible]
    if any(not intensity.off(x) for x in reach):
        assert not intensity.off(value)
        assert "NO BALLS THAT SUIT" not in made.reasons["process.intensity_mmA"]
    else:
        assert "NO BALLS THAT SUIT" in made.reasons["process.intensity_mmA"]
    assert made.design.process.intensity_mmA == (intensity.low, intensity.high)


@pytest.mark.parametrize(
    ("given", "ball_mm"),
    [("0.10-0.15A", 1.5), pytest.param("0.03-0.05A", 1.0, marks=pytest.mark.long)],
)
def test_larger_balls_that_serve_most_are_taken_only_for_the_intensity(
    plate: Path, shop: Shop, given: str, ball_mm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With I = D A / 500 mmA, balls of 1 mm reach 0.08 mmA."""
    wanted, law = Wanted("mm", shop=shop), Machine(2e-3, q=1.0)
    by_size = {
        ball: propose(plate, replace(wanted, ball_mm=ball), lambda _: []) for ball in (1.0, 1.5)
    }
    small, large = ([one for one in SETTINGS if one.ball_mm == ball] for ball in (1.0, 1.5))
    possible = Settings(small, large, {1.0: fit(1, served=0.97), 1.5: fit(1.5, served=0.85)})
    monkeypatch.setattr(
        "chamberopt.chamber.propose.proposed_intensity.settings_of", lambda *_: possible
    )
    made = propose_intensity(
        by_size[1.0],
        wanted,
        WantedIntensity.parse(given),
        lambda other: by_size[other.ball_mm or 0.0],
        law.simulate,
    )
    assert setting_of(made).ball_mm == ball_mm
    reason = made.reasons["shot.diameter_mm"]
    told = "they suit 85% of the target, and 1 mm would suit 97%, with about 0.08 mmA"
    assert (told in reason) == (ball_mm == 1.5)


@pytest.mark.parametrize(("served", "text"), [(0.85, "they suit 85%"), (0.04, "they touch 98%")])
def test_poses_are_compared_with_balls_that_the_intensity_takes(
    plate: Path, shop: Shop, served: float, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Balls of 1 mm give 0.11 mmA at 40 µm: those of 2 mm are the nearest to the range's middle.

    That these suit little of the target does not count where they touch all of it.
    """
    made = propose(plate, Wanted("mm", ball_mm=1.0, shop=shop), lambda _: [])
    each = {ball: [x for x in SETTINGS if x.ball_mm == ball] for ball in (1.0, 1.5, 2.0, 3.0)}
    fits = {1.0: fit(1.0), **{ball: fit(ball, served=served) for ball in (1.5, 2.0, 3.0)}}
    larger = [*each[1.5], *each[2.0], *each[3.0]]
    possible = Settings(each[1.0], larger, fits)
    monkeypatch.setattr(
        "chamberopt.chamber.propose.proposed_intensity.settings_of", lambda *_: possible
    )
    found = larger_balls(made, Wanted("mm"), WantedIntensity(0.18, 0.27), 0.11)
    assert found is not None
    assert found[0] == 2.0
    assert found[1].startswith(LARGER)
    assert text in found[1]
    assert larger_balls(made, Wanted("mm"), WantedIntensity(0.08, 0.27), 0.11) is None


def test_what_is_written_loads_and_has_the_band_beside_the_value(
    plate: Path, shop: Shop, tmp_path: Path
) -> None:
    wanted = Wanted("mm", ball_mm=2.0, shop=shop, coverage=200.0)
    bare = propose(plate, wanted, lambda _: [])
    assert {one.ball_mm for one in settings_of(bare, wanted).serving} == {2.0}  # as asked
    far = WantedIntensity.parse("1.0-1.2A")
    made = propose_intensity(bare, wanted, far, lambda _: bare, Machine(2.0e-3).simulate)
    reason = made.reasons["process.intensity_mmA"]
    assert "it takes an amplitude of about" in reason
    assert "within a factor of 2.5" in reason
    (tmp_path / "design.toml").write_text(design_text(made, tmp_path))
    design = load_design(tmp_path / "design.toml")
    assert design.process.intensity_mmA == (1.0, 1.2)
    assert design.process.coverage_percent == 200.0
    study = study_texts(made, "design.toml")["study.toml"]
    assert "# strength_um = { min = 74.1, max = 88.9 }" in study  # 1e3 / 13.5
    assert "\n[constraints]" not in study


def test_a_calibration_is_named_in_the_design_and_limits_the_study(
    plate: Path, shop: Shop, tmp_path: Path
) -> None:
    machine = tmp_path / "machines" / "machine.toml"
    machine.parent.mkdir()
    machine.write_text(
        'program = "0.2"\nparameters = ["K", "beta"]\nlog_mean = [2.5, 0.0]\n'
        "log_covariance = [[1e-4, 0.0], [0.0, 1e-4]]\namplitude_um = [20.0, 40.0]\n"
        "ball_diameter_mm = [1.0, 3.0]\nball_density_kg_m3 = 7810.0\n"
    )
    wanted = Wanted("mm", shop=shop, calibration=machine)
    bare = propose(plate, wanted, lambda _: [])
    intensity = WantedIntensity.parse("0.17-0.23A")

    def simulate(_: Proposal) -> IntensityPilot:
        return IntensityPilot(PredictedIntensity(0.20, 0.19, 0.21), 100.0)

    made = propose_intensity(bare, wanted, intensity, lambda _: bare, simulate)
    text = made.reasons["process.intensity_mmA"]
    assert "predicted 0.200 ± 0.010 mmA; aimed at 0.17-0.23A, asked: 0.17-0.23A; inside" in text
    folder = tmp_path / "proposed"
    folder.mkdir()
    (folder / "design.toml").write_text(design_text(made, folder))
    assert 'calibration = "../machines/machine.toml"' in (folder / "design.toml").read_text()
    design = load_design(folder / "design.toml")
    assert design.calibration is not None
    assert design.calibration.factor("K") == pytest.approx(math.exp(2.5))
    (folder / "study.toml").write_text(study_texts(made, "design.toml")["study.toml"])
    limits = load_study(folder / "study.toml").constraints["almen_intensity"]
    assert (limits.min, limits.max) == (0.17, 0.23)
    machine.write_text(machine.read_text() + 'strips = "disc of 40 mm"\n')
    discs = propose(plate, wanted, lambda _: [])
    with pytest.raises(InputError, match=r"--calibration: .* a disc of 40 mm, which are not mmA"):
        propose_intensity(discs, wanted, intensity, lambda _: discs, simulate)


def test_settings_that_are_not_resolved_are_given_up(plate: Path, shop: Shop) -> None:
    """Only the first pilot tells anything: its setting is proposed, and said to be far off."""
    wanted, runs = Wanted("mm", ball_mm=2.0, shop=shop), []
    bare = propose(plate, wanted, lambda _: [])

    def simulate(made: Proposal) -> IntensityPilot | None:
        runs.append(setting_of(made))
        return Machine(2.0e-3).simulate(made) if len(runs) == 1 else None

    far = WantedIntensity.parse("0.04-0.05A")
    made = propose_intensity(bare, wanted, far, lambda _: bare, simulate)
    assert setting_of(made) == runs[0]
    assert len(runs) == len(set(runs)) <= MOST_PILOTS
    assert "NO BALLS THAT SUIT" in made.reasons["process.intensity_mmA"]


def test_a_shot_that_dents_no_strip_is_refused(plate: Path, shop: Shop) -> None:
    wanted = Wanted("mm", shop=shop)
    bare = propose(plate, wanted, lambda _: [])
    intensity = WantedIntensity.parse("0.2-0.3A")
    with pytest.raises(InputError, match="--intensity: the shot hardly dents a strip"):
        propose_intensity(bare, wanted, intensity, lambda _: bare, lambda _: None)


@pytest.mark.parametrize(("percent", "longer"), [(None, 1.0), (100.0, 1.0), (200.0, 2.0)])
def test_the_time_is_the_wanted_multiple_of_that_to_98(
    percent: float | None, longer: float
) -> None:
    found = Measured(1e6, 1e4, 1000.0, True, 10.0, False, 0.0, 1e-3, 4.0, 900.0)
    budget = propose_budget(found, Asked(percent))
    assert budget.treatment >= 1.3 * longer * 1000.0
    reason = budget.reasons["process.treatment_time_s"]
    assert f"{budget.treatment / 1000.0:.2g} times as long" in reason
    assert ("2 times that for the 200 %" in reason) == (longer == 2.0)


def test_a_wanted_intensity_is_simulated_until_its_strength_is_resolved() -> None:
    """2,000 dents a window, in windows of 1 mm² where 1 dent falls in a second of all replicas."""
    found = Measured(1e6, 1e3, 1000.0, True, 10.0, False, 0.0, 1e-3, 4.0, 900.0)
    asked = None, Asked(None, 2e3), Asked(None, 2e3, in_search=True)
    bare, strong, limited = (propose_budget(found, one) for one in asked)
    dents = [10.0 * one.time * one.gauge_mm2 for one in (bare, strong, limited)]
    assert 32.5 <= dents[0] < 100.0
    assert dents[1] >= 2e3
    assert strong[:4] == limited[:4]
    assert bare.search_time == pytest.approx(50.0, rel=0.01)  # twice the 25 that a time takes
    assert strong.search_time == pytest.approx(50.0 / strong.gauge_mm2, rel=0.01)
    assert limited.search_time == pytest.approx(2e3 / limited.gauge_mm2, rel=0.01)
    # Nobody asked for it: the longest time, as it may be resolved then, and windows of 1 mm².
    no_wish = propose_budget(found._replace(collision_rate=1e4), Asked(None, 2e3, is_wish=False))
    assert 10.0 * no_wish.time == pytest.approx(2e7 / 1e4)
    few = propose_budget(found._replace(collision_rate=1e6), Asked(None, 2e3, is_wish=False))
    assert (10.0 * few.time, few.gauge_mm2) == (pytest.approx(20.0), 2.0)
    assert "TOO FEW" not in few.reasons["process.accuracy.simulated_time_s"]


def test_a_wanted_intensity_that_is_no_range_is_named() -> None:
    from chamberopt.design.process import Process

    for given in ((0.2, 0.15), (0.0, 0.2), (-1.0, 0.2)):
        with pytest.raises(InputError, match="intensity_mmA: given"):
            validate(Process, {"treatment_time_s": 10.0, "intensity_mmA": given})
    with pytest.raises(InputError, match="coverage_percent"):
        validate(Process, {"treatment_time_s": 10.0, "coverage_percent": 50.0})


def test_a_setting_has_its_units() -> None:
    assert Setting(1.5, 27.5).in_words == "1.5 mm at 27.5 µm"


def test_without_a_wish_the_expected_intensity_stands_beside_the_usual_one(
    plate: Path, shop: Shop
) -> None:
    """A plate of 8 mm of titanium, 0.006 to 0.010 in; of nickel there is no usual range."""
    made = propose(plate, Wanted("mm", shop=shop, alloy="Ti-6Al-4V"), lambda _: [])
    assert "not known" in with_expected_intensity(made, None).reasons[INTENSITY]
    without = with_usual_intensity(made).reasons[INTENSITY]
    assert without.startswith("not estimated without a pilot; 0.15-0.25A are usual for titanium")
    predicted = PredictedIntensity(0.31, 0.05, 1.9, 2.5)
    told = with_expected_intensity(made, predicted).reasons[INTENSITY]
    assert (
        "expected 0.31 mmA, within a factor of 2.5; OUTSIDE THE USUAL RANGE, 0.15-0.25A, " in told
    )
    for value, beside in ((0.2, False), (0.26, True)):
        near = with_expected_intensity(made, PredictedIntensity(value, 0.05, 1.9, 2.5))
        assert (
            "0.15-0.25A are usual for titanium of 8 mm under the target" in near.reasons[INTENSITY]
        )
        assert ("nothing but strips tells" in near.reasons[INTENSITY]) is beside
    assert "THIN" not in told
    wanted = usual_for(made)
    assert (wanted.low, wanted.high) == (0.15, 0.25)
    nickel = propose(plate, Wanted("mm", shop=shop, alloy="IN718"), lambda _: [])
    assert with_usual_intensity(nickel) is nickel
    assert "no range for nickel" in with_expected_intensity(nickel, predicted).reasons[INTENSITY]
    with pytest.raises(InputError, match=r"--intensity: given usual, but .*nickel"):
        usual_for(nickel)


def test_a_usual_intensity_is_aimed_at_and_is_no_wish(plate: Path, shop: Shop) -> None:
    """A machine whose largest amplitude gives 0.36 mmA, where 0.15 to 0.25 are usual."""
    wanted, law = Wanted("mm", shop=shop, alloy="Ti-6Al-4V"), Machine(0.36 / 3.0 / 40.0**0.9)
    made = propose(plate, wanted, lambda _: [])
    pilot = law.simulate(made)
    assert pilot is not None
    assert is_off(made, pilot.predicted)
    assert not is_off(made, PredictedIntensity(0.2, 0.03, 1.2, 2.5))
    assert not is_off(made, None)
    aimed = propose_intensity(
        made, wanted, usual_for(made), lambda one: propose(plate, one, lambda _: []), law.simulate
    )
    assert as_no_wish(made) == made  # no pilot told an intensity
    free = as_no_wish(aimed)
    assert free.design.process.intensity_mmA is None
    assert "intensity_mmA" not in free.tables["process"]
    assert setting_of(free) == setting_of(aimed) != setting_of(made)
    assert "chosen for the intensity" in free.reasons["sonotrode.amplitude_pv_um"]
    told = free.reasons[INTENSITY]
    assert told.startswith("predicted 0.")
    assert "aimed at 0.15-0.25A, usual for titanium of 8 mm under the target" in told
    assert f"# Almen intensity: {told}" in design_text(free, Path())


def test_a_weak_intensity_stands_on_n_strips_too(plate: Path, shop: Shop) -> None:
    made = propose(plate, Wanted("mm", shop=shop), lambda _: [])
    told = with_expected_intensity(made, PredictedIntensity(0.06, 0.01, 0.36, 2.5))
    assert "0.06 mmA, within a factor of 2.5 (0.18 mm on N strips)" in told.reasons[INTENSITY]


@pytest.mark.parametrize("metal", [pytest.param("IN718", marks=pytest.mark.long), "Ti-6Al-4V"])
def test_thin_places_are_told_of_every_metal(tmp_path: Path, shop: Shop, metal: str) -> None:
    for thick, is_thin in ((1.5, True), (3.0, False)):
        path = tmp_path / f"{thick}.stl"
        trimesh.creation.box((40, 40, thick)).export(path)
        made = with_thin_places(propose(path, Wanted("mm", shop=shop, alloy=metal), lambda _: []))
        told = made.reasons["shot.diameter_mm"]
        assert ("THIN PLACES: 5% of the target has 1.5 mm of metal or less" in told) is is_thin
        # The least amplitude of the sonotrode is half of the proposed one.
        strong = with_expected_intensity(made, PredictedIntensity(0.1, 0.02, 0.5, 2.5))
        said = f"; at 20 µm, the least, about {0.1 * 0.5**AMPLITUDE_POWER:.2g} mmA, more slowly"
        assert (said in strong.reasons[INTENSITY]) is is_thin


def test_where_a_quarter_is_too_thin_no_intensity_is_usual(tmp_path: Path, shop: Shop) -> None:
    """A plate of 8 mm of which a part goes on as a sheet of 1.5 mm: more than half is thick."""
    sheet = trimesh.creation.box(bounds=[[39, 0, 0], [70, 40, 1.5]])
    plate = trimesh.creation.box(bounds=[[0, 0, 0], [40, 40, 8]])
    trimesh.boolean.union([plate, sheet]).export(tmp_path / "step.stl")
    wanted = Wanted("mm", shop=shop, alloy="Ti-6Al-4V")
    made = propose(tmp_path / "step.stl", wanted, lambda known: [one.name for one in known])
    with pytest.raises(InputError, match=r"a quarter of the target is 1\.5 mm"):
        usual_for(made)
    assert not is_off(made, PredictedIntensity(0.5, 0.05, 1.9, 2.5))


def pilot_of(intensity: float, seconds: float) -> Measured:
    """What a pilot says of a design with an intensity [mmA] and a time to 98 % [s]."""
    predicted = PredictedIntensity.estimated(Estimate(intensity / 13.5e-3, 0.0))
    common = 1e5, 1e4, seconds, True, 1.0, True, 0.01, 5e-3, 6.4, seconds
    return Measured(*common, intensity=predicted)


def test_pilots_compare_larger_balls_up_to_those_that_give_the_intensity(
    plate: Path, shop: Shop
) -> None:
    """Balls of 1 mm give half of the least intensity, so that balls of 2 mm give it."""
    wanted, asked = Wanted("mm", shop=shop), WantedIntensity(0.10, 0.15)
    made = propose(plate, replace(wanted, ball_mm=1.0), lambda _: [])

    def sizes(found: Measured | None, asked: WantedIntensity | None, small: float = 1.0) -> list:
        return [one.ball_mm for one in settings_beside(made, wanted, asked, found, small)]

    weak = pilot_of(0.05, 600.0)
    beside = settings_beside(made, wanted, asked, weak, 1.0)
    assert beside == [Setting(1.5, 40.0), Setting(2.0, 40.0)]
    assert sizes(pilot_of(0.02, 600.0), asked) == [1.5, 2.0, 3.0]
    assert sizes(pilot_of(0.12, 600.0), asked) == [2.0]  # twice as large
    assert sizes(pilot_of(0.12, 600.0), asked, small=3.0) == [3.0]
    assert sizes(pilot_of(0.12, 600.0), None) == [1.5, 2.0]
    assert sizes(weak, asked, small=3.0) == [1.5, 2.0, 3.0]
    assert sizes(None, asked) == []
    assert settings_beside(made, replace(wanted, ball_mm=1.0), asked, weak, 1.0) == []


def test_larger_balls_are_taken_that_give_the_intensity_and_are_no_slower(
    plate: Path, shop: Shop
) -> None:
    wanted, asked = Wanted("mm", shop=shop), WantedIntensity(0.10, 0.15)
    made, larger = (
        propose(plate, replace(wanted, ball_mm=ball), lambda _: []) for ball in (1.0, 2.0)
    )
    now = Compared(made, pilot_of(0.05, 600.0))
    good = Compared(larger, pilot_of(0.12, 100.0))
    trials = of_ball_sizes([good, now])
    assert [one.ball_mm for one in trials] == [1.0, 2.0]
    assert [one.time_to_98 for one in trials] == [600.0, 100.0]
    taken = larger_instead(now, [good], trials, asked)
    assert taken is not None
    assert taken.made.design == larger.design
    reason = taken.made.reasons["shot.diameter_mm"]
    assert reason.startswith("LARGER BALLS FOR THE INTENSITY: by pilots 1 mm at 40 µm are")
    assert "these touch 100% of the target" in reason
    assert "and cover it no later; 0% of the target lies in fillets" in reason
    strong = pilot_of(0.12, 100.0)
    for other in (
        Compared(larger, pilot_of(0.12, 700.0)),  # later
        Compared(larger, pilot_of(0.2, 100.0)),  # beyond the range
        Compared(larger, strong._replace(places=False)),  # on average alone
        Compared(larger, strong._replace(intensity=None)),
        Compared(larger, None, "balls jam in a gap"),
    ):
        assert larger_instead(now, [other], trials, asked) is None
    assert larger_instead(now, [], (), asked) is None  # no other size could be tried
    enough = Compared(made, pilot_of(0.12, 600.0))
    assert larger_instead(enough, [good], trials, asked) is None
    # Of very many balls, larger ones that are far fewer are taken, though the intensity is met.
    ball_g = 1e3 * made.design.shot.ball_mass
    many = replace(made, design=made.design.changed({"shot.mass_g": 4000 * ball_g}))
    taken = larger_instead(enough._replace(made=many), [good], trials, asked)
    assert taken is not None
    assert taken.made.design == larger.design
    reason = taken.made.reasons["shot.diameter_mm"]
    assert reason.startswith("FEWER BALLS, decide: these, ")
    assert "touch 100% of the target, suit 100% and cover it about as soon" in reason
    why, (settle,) = clauses(reason)
    assert not why
    assert settle.text.endswith("as the rest: then --ball-mm 1")
    assert "about as soon by pilots as 4,000 of 1 mm" in reason
    slow = good._replace(found=pilot_of(0.12, 700.0))
    assert larger_instead(enough._replace(made=many), [slow], trials, asked) is None
    # The smallest that does it is taken.
    (small,) = (Compared(propose(plate, replace(wanted, ball_mm=1.5), lambda _: []), strong),)
    three = [good, small]
    taken = larger_instead(now, three, of_ball_sizes([now, *three]), asked)
    assert taken is not None
    assert setting_of(taken.made).ball_mm == 1.5


@pytest.mark.parametrize(("low", "taken"), [(0.25, 1.5), (0.35, 1.2)])
def test_balls_that_serve_less_are_taken_only_into_the_range(low: float, taken: float) -> None:
    fine, coarse = Setting(1.2, 40.0), Setting(1.5, 40.0)
    wanted = WantedIntensity(low, 1.2 * low, "")
    found = choose(wanted, [fine, coarse], {fine: 0.2}, {1.2: 0.99, 1.5: 0.93})
    assert found.ball_mm == taken


def test_what_an_intensity_needs_undoes_what_it_is_off_by_the_law(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        proposed_intensity, "setting_of", lambda _: SimpleNamespace(amplitude_um=40.0, ball_mm=3.0)
    )
    made: Any = None
    for times, larger in ((2.0, "80 µm"), (0.5, "20 µm")):
        told = proposed_intensity._needed(made, -AMPLITUDE_POWER * math.log(times))
        assert f"amplitude of about {larger} zero-to-peak" in told
        assert ("larger than the target's fillets" in told) == (times > 1.0)
    for times, larger in ((2.0, "6 mm"), (0.5, "1.5 mm")):
        told = proposed_intensity._needed(made, -BALL_POWER * math.log(times))
        assert f"balls of about {larger}" in told
