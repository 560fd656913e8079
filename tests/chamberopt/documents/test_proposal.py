"""The end of `new` on a terminal."""

import re
from dataclasses import replace

import pytest
import trimesh

from chamberopt.chamber.layout.balls import SizeFit
from chamberopt.chamber.matters import Matter, MatterKind, Urgency, matter_of
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import BallTrial, Proposal, Wanted
from chamberopt.chamber.propose.proposed_budget import within_room
from chamberopt.chamber.propose.proposed_mask import LeftOut
from chamberopt.common.estimate import Estimate
from chamberopt.design.intensity import PredictedIntensity, WantedIntensity
from chamberopt.documents.proposal import (
    WIDTH,
    _in_short,
    _intensity,
    _strips,
    clauses,
    proposal_in_words,
    proposal_lines,
    time_in_words,
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Proposal:
    path = tmp_path_factory.mktemp("part") / "box.stl"
    trimesh.creation.box((20, 20, 30)).export(path)
    return propose(path, Wanted("mm"), lambda _: [])


def test_all_that_is_to_be_settled_is_one_list(made: Proposal) -> None:
    """What reasons say in capitals, and what the shot meets beside the target."""
    left_out = [LeftOut({}, "NOT MASKED: the shot also meets PIN")]
    text = "\n".join(proposal_lines(proposal_in_words(made, left_out), verbose=False))
    told, _, settle = text.partition("\nTo be settled before it is built:\n")
    assert "ALLOY NOT KNOWN" in settle
    assert "TIME NOT MEASURED" in settle
    assert "NOT MASKED" in settle
    assert not any(mark in told for mark in ("ALLOY NOT", "NOT MEASURED", "NOT MASKED"))
    assert told.startswith("Peen face 1 (")
    assert max(map(len, text.splitlines())) <= WIDTH


@pytest.mark.parametrize(
    ("name", "told"),
    [("bevels", "the welds (bevels)"), ("fillets of 2 mm", "fillets of 2 mm"), ("PIN", "PIN")],
)
def test_only_bevels_are_called_welds(made: Proposal, name: str, told: str) -> None:
    """Fillets have a strip beside them too, and are none."""
    of_it = replace(made, reasons={**made.reasons, "part.target": f"{name}: as asked"})
    assert proposal_in_words(of_it, []).sentence.startswith(f"Peen {told} (")


def test_the_area_of_a_target_says_what_it_takes_beside_its_faces(made: Proposal) -> None:
    given = replace(made, design=made.design.changed({"part.target.beside_mm": 2.0}))
    assert " and 2 mm beside them (" in proposal_in_words(given, []).sentence


@pytest.mark.parametrize("room", [1e6, 20.0, 4.0])
def test_what_no_pilot_measured_stays_within_a_modest_memory_too(
    made: Proposal, room: float
) -> None:
    bounded = within_room(made, room)
    accuracy = bounded.design.process.accuracy
    assert accuracy.max_replicas * accuracy.simulated_time <= room
    assert bounded.tables["process.accuracy"]["simulated_time_s"] == accuracy.simulated_time
    told = [text for text in bounded.reasons.values() if "to stay within 2 GB" in text]
    assert len(told) == (room < 24.0)


def test_the_target_has_one_area_and_a_time_that_no_pilot_told_is_a_start(made: Proposal) -> None:
    """Rounds that are divided make it larger than in the file."""
    part = replace(made.chamber.part, area=1.01 * made.chamber.part.area)
    larger = replace(made, chamber=replace(made.chamber, part=part))
    told = proposal_in_words(larger, [])
    area = f"{1e6 * part.area[part.target].sum():.0f} mm²"
    assert f"face 1 ({area}) of box.stl for 5 min (a start) with" in told.sentence
    assert next(one.value for one in told.rows if one.name == "time") == "5 min (a start)"
    (target,) = (one for one in told.choices if one.is_target)
    assert target.text.endswith(f", {area} in all") or target.text == area
    assert "Surfaces to choose from (--target), places in the part's file:" in proposal_lines(
        told, verbose=False
    )
    of_pilot = {**made.reasons, "process.treatment_time_s": "an estimate"}
    told = proposal_in_words(replace(made, reasons=of_pilot), [])
    assert "for 5 min with" in told.sentence
    unresolved = {
        **of_pilot,
        "process.treatment_time_s": "an estimate; TIME NOT RESOLVED for single",
    }
    told = proposal_in_words(replace(made, reasons=unresolved), [])
    assert "for 5 min (a start) with" in told.sentence


def test_balls_that_are_many_are_told_with_what_pilots_say_of_larger_ones(made: Proposal) -> None:
    ball = made.tables["shot"]["diameter_mm"]
    assert not any(one.kind is MatterKind.MANY_BALLS for one in proposal_in_words(made, []).matters)
    grams = 1e3 * made.design.shot.mass * 5200.4 / made.design.shot.count
    many = replace(made, design=made.design.changed({"shot.mass_g": grams}))
    fit = SizeFit(1e-3 * ball + 1e-3, 0.99, 0.83, True, 0.0, 100)
    fewer = BallTrial(ball + 1.0, 40.0, 900, 1, fit, 95.0, True, None, "")
    others = (replace(fewer, ball_mm=ball), replace(fewer, ball_mm=ball + 0.5, count=6000), fewer)
    for trials, more in (((), ""), (others, f": {ball + 1:g} mm would suit 83%")):
        matters = proposal_in_words(replace(many, trials=trials), []).matters
        told = next(one.text for one in matters if one.kind is MatterKind.MANY_BALLS)
        count = many.design.shot.count
        assert count == pytest.approx(5200, rel=1e-3)
        assert told == f", {count:,}, to be dosed and sorted{more}."


@pytest.mark.parametrize(
    ("seconds", "touched", "is_told"),
    [(3100.0, 0.99, True), (20000.0, 0.99, False), (3100.0, 0.9, False)],
)
def test_balls_that_are_much_quicker_than_a_long_time_are_told(
    made: Proposal, seconds: float, touched: float, is_told: bool
) -> None:
    ball = made.tables["shot"]["diameter_mm"]
    fit = SizeFit(1e-3 * ball, 0.99, 0.93, True, 0.0, 100)
    taken = BallTrial(ball, 20.0, 1200, 1, fit, 27000.0, True, None, "")
    other = replace(
        taken, ball_mm=ball + 1.0, time_to_98=seconds, fit=replace(fit, touched=touched)
    )
    unknown = replace(taken, ball_mm=ball + 2.0, time_to_98=None)
    matters = proposal_in_words(replace(made, trials=(taken, other, unknown)), []).matters
    told = [one.text for one in matters if one.kind is MatterKind.QUICKER_BALLS]
    assert told == [f": of {ball + 1:g} mm, by pilots about 3100 s."] * is_told


def test_the_balls_that_pilots_compared_are_one_table(made: Proposal) -> None:
    """Each row has what is known of it: a time of places or on average, or why no pilot ran."""
    assert proposal_in_words(made, []).trials is None
    ball = made.tables["shot"]["diameter_mm"]
    fit = SizeFit(1e-3 * ball, 0.99, 0.93, True, 0.0, 100)
    known = PredictedIntensity(0.214, 0.1, 0.4, 2.5)
    first = BallTrial(ball, 40.0, 1200, 1, fit, 812.0, True, known, "")
    second = replace(first, ball_mm=ball + 1.0, time_to_98=95.0, is_of_places=False, intensity=None)
    third = replace(second, ball_mm=ball + 2.0, time_to_98=None, harm="balls jam in a gap")
    told = proposal_in_words(replace(made, trials=(first, second, third)), []).trials
    assert told is not None
    assert told.rows == [
        [f"{ball:g} mm, taken", "99%", "93%", "40 µm", "0.21 mmA", "810 s", "1,200"],
        [f"{ball + 1:g} mm", "99%", "93%", "40 µm", "not known", "95 s on average", "1,200"],
        [f"{ball + 2:g} mm", "99%", "93%", "40 µm", "not known", "not tried", "1,200"],
    ]
    assert told.caption.endswith(f"; {ball + 2:g} mm not tried: balls jam in a gap")
    two = replace(second, sonotrode_count=2)
    several = proposal_in_words(replace(made, trials=(first, two)), [])
    assert several.trials is not None
    assert [row[-1] for row in several.trials.rows] == ["1", "2"]
    assert several.trials in proposal_lines(several, verbose=False)


def test_verbose_has_every_reason_and_every_surface(made: Proposal) -> None:
    short, text = (
        " ".join(" ".join(proposal_lines(proposal_in_words(made, []), verbose=one)).split())
        for one in (False, True)
    )
    for name in ("shot.diameter_mm", "chamber.length_mm", "process.accuracy.simulated_time_s"):
        for clause in clauses(made.reasons.get(name, ""))[0]:
            assert clause in text
    assert made.reasons["process.accuracy.simulated_time_s"] not in short
    for one in made.known:
        assert f"{one.name}: {one.text}" in text


@pytest.mark.parametrize(
    ("reason", "why", "settle"),
    [
        ("", [], []),
        ("half a layer", ["half a layer"], []),
        ("suits all; BALLS JAM in gaps; 2 mm", ["suits all", "2 mm"], ["BALLS JAM in gaps"]),
        ("SAE AMS 2430 says", ["SAE AMS 2430 says"], []),
        ("LONG: turn it", [], ["LONG: turn it"]),
        ("TURNED BY A DRIVE, at 60 rpm", [], ["TURNED BY A DRIVE, at 60 rpm"]),
    ],
)
def test_clauses_of_a_kind_are_matters(reason: str, why: list[str], settle: list[str]) -> None:
    assert clauses(reason) == (why, [*map(matter_of, settle)])


def test_a_time_has_the_unit_of_a_timer() -> None:
    assert [time_in_words(one) for one in (45, 600, 5400, 14400)] == [
        "45 s",
        "10 min",
        "90 min",
        "4 h",
    ]


def test_matters_are_listed_by_their_urgency(made: Proposal) -> None:
    reasons = {
        **made.reasons,
        "shot.mass_g": "half a layer; CHARGE IS CUT for the simulation; NO SIZE SUITS ALL, as told",
        "materials.part": "ALLOY NOT KNOWN, a guess",
    }
    told = proposal_in_words(replace(made, reasons=reasons), [])
    kinds = [one.kind for one in told.matters]
    assert kinds.index(MatterKind.NO_SIZE) < kinds.index(MatterKind.CHARGE_CUT)
    assert kinds.index(MatterKind.CHARGE_CUT) < kinds.index(MatterKind.ALLOY)
    lines = proposal_lines(told, verbose=False)
    heads = [lines.index(f"{one.in_words}:") for one in Urgency]
    assert heads == sorted(heads)


def test_each_kind_is_known_by_its_own_words() -> None:
    for kind in MatterKind:
        assert matter_of(f"{kind}, then more") == Matter(kind, ", then more")
    assert matter_of("SAE AMS 2430 has it").kind is None


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.20, "inside the usual 0.2 to 0.3 mmA."),
        (0.10, "outside the usual 0.2 to 0.3 mmA."),
        (0.60, "outside the usual 0.2 to 0.3 mmA."),
    ],
)
def test_an_intensity_stands_beside_its_range_and_only_strips_decide(
    made: Proposal, value: float, words: str
) -> None:
    usual = WantedIntensity(0.2, 0.3)
    rough = PredictedIntensity.estimated(Estimate(value / 13.5e-3, 0.0))
    known = PredictedIntensity(value, value, value, 1.0)
    about = f" Almen intensity about {value:.2g} mmA"
    told = _intensity(replace(made, expected=rough, usual=usual))
    assert told == f"{about}, within a factor of 2.5; usual: 0.2 to 0.3 mmA. Strips decide."
    assert _intensity(replace(made, expected=known, usual=usual)) == f"{about}, {words}"
    assert _intensity(replace(made, expected=None, usual=usual)) == ""
    assert _intensity(replace(made, expected=rough, usual=None)).endswith(" of 2.5.")


def test_strips_are_told_with_the_command_that_peens_them(made: Proposal) -> None:
    """Where they are held, by their screws and their block, is that of the process sheet."""
    wide = {"shape": "cylinder", "diameter_mm": 90.0, "height_mm": 60.0}
    wide["sonotrode_distance_mm"] = 15.0
    for room, told in (
        (wide, r"A strips in the lid in place of the part, \S+ mm .* strip --distance-mm \S+$"),
        (
            wide | {"diameter_mm": 60.0},
            r"pieces of \S+ × 19 mm cut from A strips, in .* no mmA until",
        ),
        (wide | {"diameter_mm": 20.0}, "accept a part by its coverage.*by a coupon of its metal"),
    ):
        design = made.design.changed({"chamber": room})
        assert re.search(told, _strips(replace(made, design=design)))
    ordered = made.design.changed({"chamber": wide, "process.intensity_mmA": (0.05, 0.08)})
    assert "strip --type N --distance-mm" in _strips(replace(made, design=ordered))


def test_several_numbered_faces_are_one_list() -> None:
    assert _in_short("face 1") == "face 1"
    assert _in_short("face 1, face 2.1") == "faces 1 and 2.1"
    assert _in_short("face 1, face 6, face 7") == "faces 1, 6 and 7"
    assert _in_short("face 1, PIN") == "face 1, PIN"
