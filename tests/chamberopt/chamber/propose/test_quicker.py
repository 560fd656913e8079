"""Poses and charges that are tried by pilots where a treatment takes long."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import warnings
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.layout.pose import Pose, end_to_wall, pose_by_size
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose import proposal
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.held_proposal import rests
from chamberopt.chamber.propose.proposal import Proposal, Wanted, with_charge
from chamberopt.chamber.propose.proposed_budget import Measured, TooSlowError
from chamberopt.chamber.propose.proposed_steps import NOT_OVER, propose_second_pose, turned_over
from chamberopt.chamber.propose.quicker import (
    NOT_COMPARED,
    SEVERAL,
    Way,
    _with_pose_told,
    propose_quicker,
)
from chamberopt.chamber.propose.text import design_text, to_settle
from chamberopt.common.errors import InputError
from chamberopt.design.intensity import PredictedIntensity
from chamberopt.design.load import load_design
from chamberopt.documents.proposal import proposal_in_words
from chamberopt.geometry.triangles import rotation_matrix
from tests.chamberopt.chamber.layout.test_arbor import part_of
from tests.helpers.turned_parts import stepped_shaft

LEAF = (130.0, 26.0, 6.0)  # mm: length, width and thickness of a bar with a broad side to peen


def measured(seconds: float, places: bool = True) -> Measured:
    """What a pilot says of a design whose target is covered after some time [s]."""
    return Measured(1e5, 1e4, seconds, places, 0.1 * seconds, True, 0.01, 5e-3, 6.4, 0.8 * seconds)


@pytest.fixture(scope="module")
def leaf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bar that stands in its file."""
    path = tmp_path_factory.mktemp("leaf") / "leaf.stl"
    box = trimesh.creation.box((LEAF[2], LEAF[1], LEAF[0]))
    box.subdivide_to_size(12.0).export(path)  # so that a box of the design can cut its end off
    return path


@pytest.fixture(scope="module")
def poses(leaf: Path) -> dict[Pose | None, Proposal]:
    """The proposals for the bar by the pose that is asked for."""
    asked: list[Pose | None] = [None, "lying", "on-edge"]
    return {one: propose(leaf, Wanted("mm", ball_mm=3.0, pose=one), lambda _: []) for one in asked}


def pilots(times: dict[Pose | None, float]) -> Callable[[Proposal, float], Measured]:
    """Return a pilot of the bar, whose time [s] follows from its pose."""
    by_height: dict[float, Pose | None] = {LEAF[0]: None, LEAF[2]: "lying", LEAF[1]: "on-edge"}

    def measure(made: Proposal, longest: float = math.inf) -> Measured:
        height = round(1e3 * float(np.ptp(made.chamber.part.vertices[:, 2])), 3)
        if times[by_height[height]] > longest:
            raise TooSlowError(f"98 % after more than {longest:g} s")
        return measured(times[by_height[height]])

    return measure


@pytest.mark.parametrize("pose", ["standing", "lying", "on-edge"])
def test_a_pose_by_size_has_that_size_upright_however_the_file_is_turned(pose: Pose) -> None:
    upright = {"standing": LEAF[0], "on-edge": LEAF[1], "lying": LEAF[2]}[pose]
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        bar = trimesh.creation.box(np.array(LEAF)[order])
        target = np.ones(len(bar.faces), dtype=bool)
        turns = pose_by_size(bar.vertices, bar.faces, target, pose)
        posed = bar.vertices @ rotation_matrix(turns).T
        assert np.ptp(posed[:, 2]) == pytest.approx(upright)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_target_on_one_side_lies_on_it(sign: float) -> None:
    bar = trimesh.creation.box(LEAF)
    target = bar.face_normals[:, 2] * sign > 0.5
    turns = pose_by_size(bar.vertices, bar.faces, target, "lying")
    down = bar.face_normals[target] @ rotation_matrix(turns).T
    np.testing.assert_allclose(down, [[0.0, 0.0, -1.0]] * 2, atol=1e-9)


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
def test_an_end_is_turned_to_the_wall_along_x(axis: list[float]) -> None:
    turns = end_to_wall((0.0, 0.0, 33.0), np.array(axis))
    np.testing.assert_allclose(rotation_matrix(turns) @ axis, [1.0, 0.0, 0.0], atol=1e-6)


@pytest.mark.long
def test_a_long_bar_is_held_in_each_pose(poses: dict[Pose | None, Proposal]) -> None:
    for pose, made in poses.items():
        assert made.chamber.pieces_in_air == 0, pose
        assert not made.jams
    # What holds it at the side is the end that goes out through a wall: no ball lies on jaws.
    for pose in ("lying", "on-edge"):
        assert poses[pose].tables["holder"]["kind"] == "bore"
        part = poses[pose].chamber.part.vertices[:, 0]
        half = 5e-4 * poses[pose].tables["chamber"]["length_mm"]
        assert part.max() > half
        assert part.min() > -half


@pytest.mark.long
def test_a_quick_design_is_not_tried_in_other_ways(poses: dict[Pose | None, Proposal]) -> None:
    def again(_: Sequence[Wanted]) -> list[Proposal | None]:
        raise AssertionError

    first = Way(poses[None], Wanted("mm"), measured(500.0))
    assert propose_quicker(first, again, turned_over, lambda *_: measured(1.0)) is first
    unknown = first._replace(found=None)
    assert propose_quicker(unknown, again, turned_over, lambda *_: measured(1.0)) is unknown


def test_the_quicker_pose_is_taken_and_all_times_are_told(
    poses: dict[Pose | None, Proposal],
) -> None:
    first = Way(poses[None], Wanted("mm"), measured(2024.0))
    measure = pilots({None: 2024.0, "lying": 900.0, "on-edge": 512.0})
    best = propose_quicker(first, of(poses), turned_over, measure)
    assert best.wanted.pose == "on-edge"
    assert best.found == measured(512.0)
    told = best.made.reasons["part.rotate_deg"]
    assert told.endswith(f": the quickest of {len(best.made.poses)} by pilots")
    assert [(one.pose, one.outcome) for one in best.made.poses if one.time_to_98 == 512.0] == [
        ("on edge", "taken")
    ]
    table = proposal_in_words(best.made, ()).poses
    assert table is not None
    names = [row[0] for row in table.rows]
    assert names[0] == "on edge"
    assert {"lying", "evenly exposed"} <= {*names}


def test_a_pose_whose_places_are_not_resolved_is_left_open_and_not_called_slower(
    poses: dict[Pose | None, Proposal],
) -> None:
    first = Way(poses[None], Wanted("mm"), measured(2024.0))
    of_all = pilots({None: 2024.0, "lying": 900.0, "on-edge": 512.0})
    for seconds, is_open in ((1000.0, True), (1030.0, False)):

        def measure(made: Proposal, longest: float = math.inf, x: float = seconds) -> Measured:
            found = of_all(made, longest)
            return measured(x, places=False) if found.time_to_98 == 512.0 else found

        best = propose_quicker(first, of(poses), lambda made: made, measure)
        assert best.found == measured(2024.0)
        outcomes = {one.pose: one.outcome for one in best.made.poses}
        assert outcomes["on edge"] == NOT_COMPARED
        assert outcomes["evenly exposed"] == "taken"
        told = to_settle(best.made, ())
        open_ = [one.text for one in told if one.kind is MatterKind.POSE]
        assert any(one.startswith(": on edge") for one in open_) is is_open


@pytest.mark.parametrize(("seconds", "taken"), [(640.0, "on-edge"), (2500.0, None)])
def test_a_longer_pilot_decides_between_poses(
    poses: dict[Pose | None, Proposal], seconds: float, taken: Pose | None
) -> None:
    """On edge on three sonotrodes: quick enough below half of a time that nobody would run."""
    of_all = pilots({None: 2024.0, "lying": 1500.0, "on-edge": 512.0})

    def brief(made: Proposal, longest: float) -> Measured:
        found = of_all(made, longest)
        return found._replace(places=found.time_to_98 > 600.0)

    def never(_: Proposal) -> Proposal:
        raise InputError("nothing would hold it")

    longer_ones: list[Proposal] = []

    def longer(made: Proposal, _: float) -> Measured:
        longer_ones.append(made)
        return measured(seconds)

    first = Way(poses[None], Wanted("mm"), measured(2024.0))
    best = propose_quicker(first, of(poses), never, brief, longer=longer)
    assert longer_ones == [poses["on-edge"]]
    assert best.wanted.pose == taken
    assert not any(one.kind is MatterKind.POSE for one in to_settle(best.made, ()))


def test_a_shaft_that_turns_is_put_on_end_only_where_that_is_clearly_quicker(
    tmp_path: Path,
) -> None:
    body = stepped_shaft([(12.0, 40.0), (20.0, 20.0), (12.0, 40.0)], 2.0)
    part = tmp_path / "shaft.stl"
    part_of(body)[1].export(part)
    made = propose(part, Wanted("mm", ball_mm=1.0), lambda _: [])
    on_end = propose(part, Wanted("mm", ball_mm=1.0, pose="standing"), lambda _: [])
    first = Way(made, Wanted("mm"), measured(1000.0))
    on_end = replace(on_end, warnings=(), jams=())  # what does harm is no choice
    for time, taken in ((900.0, None), (700.0, "standing")):

        def again(many: Sequence[Wanted]) -> list[Proposal | None]:
            return [on_end if one.pose == "standing" else None for one in many]

        pilot = measured(time)
        best = propose_quicker(first, again, turned_over, lambda *_, x=pilot: x)
        assert best.wanted.pose == taken
        assert {one.pose for one in best.made.poses} == {"turning", "standing"}


def test_a_lying_part_on_which_balls_would_rest_is_tried_turned_over(
    poses: dict[Pose | None, Proposal],
) -> None:
    lying = poses["lying"]
    assert rests(lying)
    of_one_pose = pilots({None: 2024.0, "lying": 100.0, "on-edge": 1900.0})

    def measure(made: Proposal, longest: float) -> Measured:
        return measured(400.0) if made.design.steps else of_one_pose(made, longest)

    first = Way(poses[None], Wanted("mm"), measured(2024.0))
    best = propose_quicker(first, of(poses), turned_over, measure)
    assert best.wanted == Wanted("mm", pose="lying", turned_over=True)
    assert best.found == measured(400.0)
    taken = [one.pose for one in best.made.poses if one.outcome == "taken"]
    assert taken == ["lying and turned over"]
    assert best.made.reasons[".steps"].startswith("turned over about x after half of the time")
    # What was turned over already is not turned over again.
    kept = propose_second_pose(best.made, uneven(900.0), lambda *_: measured(1.0))
    assert kept == (best.made, uneven(900.0))


def test_balls_that_rest_on_what_is_turned_down_later_are_no_warning(
    poses: dict[Pose | None, Proposal],
) -> None:
    lying = poses["lying"]
    before = f"{lying.reasons['part.rotate_deg']}{NOT_OVER}: by a pilot with other balls"
    over = turned_over(replace(lying, reasons={**lying.reasons, "part.rotate_deg": before}))
    assert over.reasons["part.rotate_deg"] == lying.reasons["part.rotate_deg"]
    assert not rests(over)
    steps = over.tables[""]["steps"]
    x, y, z = over.design.part.rotate_deg
    steps = [steps[0], {**steps[1], "part": {"rotate_deg": [x, y, z + 180.0]}}]
    turned = over.design.changed({"steps": steps, "holder": None})
    assert rests(replace(over, warnings=tuple(warnings(turned, build_chamber(turned)))))


def test_more_sonotrodes_must_save_more_time(poses: dict[Pose | None, Proposal]) -> None:
    count = poses["on-edge"].sonotrode_count
    assert count > 1
    assert poses[None].sonotrode_count == 1
    for share, taken in ((0.85 / count, None), (0.75 / count, "on-edge")):
        first = Way(poses[None], Wanted("mm"), measured(1000.0))
        measure = pilots({None: 1000.0, "lying": 2000.0, "on-edge": share * 1000.0})
        best = propose_quicker(first, of(poses), turned_over, measure)
        assert best.wanted.pose == taken
        outcomes = {one.pose: one.outcome for one in best.made.poses}
        told = "taken" if taken else "not quick enough for more sonotrodes"
        assert outcomes["on edge"] == told


def test_what_is_not_the_quickest_is_not_called_so(poses: dict[Pose | None, Proposal]) -> None:
    first = Way(poses["lying"], Wanted("mm"), measured(3000.0))
    best = Way(poses[None], Wanted("mm", pose="standing"), measured(700.0))
    for seconds, told in ((400.0, "what is against quicker ones"), (1100.0, "the quickest of 3")):
        other = Way(poses["on-edge"], Wanted("mm", pose="on-edge"), measured(seconds))
        made = _with_pose_told(best, first, [(best, ""), (other, "")]).made
        assert told in made.reasons["part.rotate_deg"]


def test_fewer_sonotrodes_are_taken_where_they_take_no_longer(
    poses: dict[Pose | None, Proposal],
) -> None:
    first = Way(poses["on-edge"], Wanted("mm"), measured(1000.0))
    for time, taken in ((1010.0, False), (990.0, True)):
        pilot = measured(time)
        best = propose_quicker(
            first, lambda many: [poses[None] for _ in many], turned_over, lambda *_, x=pilot: x
        )
        assert (best.made.sonotrode_count == 1) is taken


def test_a_time_that_nobody_would_run_is_worth_some_sonotrodes(
    poses: dict[Pose | None, Proposal],
) -> None:
    assert poses["on-edge"].sonotrode_count <= SEVERAL
    for alone, beside, taken in ((1700.0, 840.0, None), (2000.0, 990.0, "on-edge")):
        times: dict[Pose | None, float] = {None: alone, "lying": 1990.0, "on-edge": beside}
        first = Way(poses[None], Wanted("mm"), measured(alone))
        best = propose_quicker(first, of(poses), turned_over, pilots(times))
        assert best.wanted.pose == taken


def test_a_quicker_way_is_no_weaker(poses: dict[Pose | None, Proposal]) -> None:
    first = Way(poses[None], Wanted("mm"), with_intensity(measured(2000.0), 0.2))
    for value, taken in ((0.15, None), (0.17, "on-edge")):
        times: dict[Pose | None, float] = {None: 2000.0, "lying": 1990.0, "on-edge": 300.0}
        measure = pilots(times)
        best = propose_quicker(
            first,
            of(poses),
            turned_over,
            lambda *given, m=measure, x=value: with_intensity(m(*given), x),
        )
        assert best.wanted.pose == taken
        (edge,) = (one for one in best.made.poses if one.pose == "on edge")
        assert edge.intensity is not None
        told = edge.time_to_98, edge.intensity.value, edge.outcome
        assert told == (300.0, value, "taken" if taken else "weaker")


def of(poses: dict[Pose | None, Proposal]) -> Callable[[Sequence[Wanted]], list[Proposal | None]]:
    return lambda many: [poses.get(one.pose) for one in many]


def with_intensity(found: Measured, value: float) -> Measured:
    return found._replace(intensity=PredictedIntensity(value, 0.5 * value, 2.0 * value, 2.5))


@pytest.mark.parametrize("share", [0.7, 0.9])
def test_a_whole_layer_is_taken_where_it_is_quicker(
    poses: dict[Pose | None, Proposal], share: float
) -> None:
    first = Way(poses[None], Wanted("mm", pose="standing"), measured(1000.0))
    best = propose_quicker(
        first,
        lambda many: [poses[None] for _ in many],
        turned_over,
        lambda *_: measured(1000.0 * share),
    )
    count = first.made.design.shot.count
    if share == 0.9:
        assert best is first
        return
    assert best.made.design.shot.count == pytest.approx(2 * count, rel=0.1)
    assert "a whole layer of balls" in best.made.reasons["shot.mass_g"]
    assert (
        "98 % after about 700 s, with half a layer 98 % after about 1000 s"
        in (best.made.reasons["shot.mass_g"])
    )


def test_a_doubled_charge_moves_its_range_too(poses: dict[Pose | None, Proposal]) -> None:
    made = poses[None]
    heavy = with_charge(made, 2.0)
    assert heavy.design.shot.mass == pytest.approx(2.0 * made.design.shot.mass, rel=0.05)
    for end in ("low", "high"):
        before, after = made.bounds["shot.mass_g"][end], heavy.bounds["shot.mass_g"][end]
        assert after == pytest.approx(2.0 * before, rel=0.1)
    assert heavy.bounds["chamber.height_mm"] == made.bounds["chamber.height_mm"]


def uneven(seconds: float) -> Measured:
    """What a pilot says of a target on which single places take three times as long."""
    return measured(seconds)._replace(mean_time=seconds / 3.0)


def test_a_part_that_lies_is_turned_over_where_that_is_quicker(
    poses: dict[Pose | None, Proposal], tmp_path: Path
) -> None:
    lying = poses["lying"]
    made, found = propose_second_pose(lying, uneven(900.0), lambda *_: measured(400.0))
    assert found == measured(400.0)
    first, other = made.design.in_steps.values()
    up, down = (rotation_matrix(one.part.rotate_deg)[2] for one in (first, other))
    np.testing.assert_allclose(up, -down, atol=1e-12)
    ends = [rotation_matrix(one.part.rotate_deg)[0] for one in (first, other)]
    np.testing.assert_allclose(*ends, atol=1e-12)  # the end in the wall stays in it
    assert [one.pieces_in_air for one in made.chamber.steps] == [0, 0]
    assert (
        "by pilots with balls of 3 mm 98 % after about 400 s, in one pose 98 % after about 900 s"
        in (made.reasons[".steps"])
    )
    (tmp_path / "design.toml").write_text(design_text(made, tmp_path), "utf-8")
    assert load_design(tmp_path / "design.toml").in_steps.keys() == {"first", "turned_over"}


@pytest.mark.parametrize(
    ("pose", "first", "second"),
    [
        ("lying", 500.0, 100.0),  # quick enough
        ("lying", 900.0, 650.0),  # not worth a second set-up
        ("on-edge", 900.0, 100.0),  # its mask goes up to the wall, from one side alone
        (None, 900.0, 100.0),  # jaws hold its upper end
    ],
)
def test_a_part_stays_in_one_pose_where_another_is_no_gain_or_not_held(
    poses: dict[Pose | None, Proposal], pose: Pose | None, first: float, second: float
) -> None:
    made = poses[pose]
    found = uneven(first)
    kept, same = propose_second_pose(made, found, lambda *_: measured(second))
    assert (kept.design, same) == (made.design, found)
    assert ("not turned over" in kept.reasons["part.rotate_deg"]) is (first > 600.0)
    assert propose_second_pose(made, None, lambda *_: measured(second)) == (made, None)


def test_a_warning_of_both_poses_is_no_reason_against_the_second(
    poses: dict[Pose | None, Proposal], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its place differs from pose to pose. A warning of the second pose alone is a reason."""

    def rest(place: int, on: str, step: str = "") -> DesignWarning:
        text = f"balls can come to rest on {on}, e.g. at ({place}, 0, 0) mm: turn it"
        return DesignWarning(WarningKind.REST, text, (on,), step)

    both = [rest(1, "the holder", "first"), rest(2, "the holder", "turned_over")]
    lying = replace(poses["lying"], warnings=(rest(1, "the holder"),))

    def pose_two(more: list[DesignWarning]) -> Proposal:
        monkeypatch.setattr(proposal, "warnings", lambda design, chamber: [*both, *more])
        return propose_second_pose(lying, uneven(900.0), lambda *_: measured(400.0))[0]

    assert pose_two([]).design.steps
    kept = pose_two([rest(3, "the part", "turned_over")])
    assert kept.design == lying.design
    assert (
        "after half of the time: balls can come to rest on the part"
        in (kept.reasons["part.rotate_deg"])
    )
