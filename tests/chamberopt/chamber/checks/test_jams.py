"""Gaps in which balls jam: slots and wedges with closed forms."""

import math

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.checks.gaps import gap_warnings
from chamberopt.chamber.checks.jams import FRICTION, JAM_BAND, find_gaps, gaps_in_reach, jam_gaps
from chamberopt.chamber.checks.place_names import PART_SIDE
from chamberopt.chamber.checks.warning import WarningKind
from tests.chamberopt.chamber.test_reach import BALL, ROOM, cavity, prism, reached, slot

LOCKING = math.degrees(math.atan(FRICTION))  # half angle of a wedge below which it is self-locking


def wedge(half_angle_deg: float, mouth_mm: float = 7.0) -> Chamber:
    """A groove 20 mm long in the ceiling that narrows from its mouth to nothing."""
    half = 0.5 * mouth_mm
    deep = half / math.tan(math.radians(half_angle_deg))
    return cavity(ROOM, prism([(-half, 10.0), (half, 10.0), (0.0, 10.0 + deep)], 20.0))


@pytest.mark.parametrize(
    ("balls", "jams"), [(0.85, False), (0.93, True), (1.0, True), (1.12, True), (1.2, False)]
)
def test_a_slot_jams_balls_if_it_is_about_as_wide(balls: float, jams: bool) -> None:
    found = jam_gaps(slot(3.0 * balls), BALL)
    assert bool(found) is jams
    for gap in found:
        width = balls * BALL
        assert gap.sides == ("the part's side", "the part's side")
        assert np.allclose(gap.width, width, rtol=1e-6)
        # Both walls, 20 mm x 6 mm, but for the strips where the floor or an end wall is nearer.
        assert gap.area == pytest.approx(2 * (20e-3 - width) * (6e-3 - 0.5 * width), rel=0.03)
        assert abs(gap.place[0]) < 1e-5
        assert 10e-3 < gap.place[2] < 16e-3
        assert gap.free_below == pytest.approx(width / JAM_BAND[1])
        assert gap.free_above == pytest.approx(width / JAM_BAND[0])
        # Balls that are a little beyond the free diameters do not jam, and others do.
        for size, free in ((gap.free_below, 0.99), (gap.free_above, 1.01)):
            assert not jam_gaps(slot(3.0 * balls), free * size)
            assert jam_gaps(slot(3.0 * balls), size / free)


@pytest.mark.parametrize("off_deg", [-2.0, 2.0])
def test_a_wedge_jams_balls_if_its_half_angle_is_below_the_angle_of_friction(
    off_deg: float,
) -> None:
    a = math.radians(LOCKING + off_deg)
    found = jam_gaps(wedge(LOCKING + off_deg), BALL)
    assert bool(found) is (off_deg < 0.0)
    for gap in found:
        # A ball of diameter w touches the flanks at w / (2 tan(a)) from the apex.
        low, high = (share * BALL for share in JAM_BAND)
        band = 2 * (20e-3 - BALL) * (high - low) / (2.0 * math.tan(a))
        assert gap.area == pytest.approx(band, rel=0.06)
        assert gap.target_share == pytest.approx(gap.area / wedge_area(a), rel=0.02)
        assert gap.free_below < 0.1 * BALL
        assert gap.free_above == math.inf  # wider than was measured


def wedge_area(a: float) -> float:
    """All of the niche: two flanks and two triangular ends [m²]."""
    return 2 * 20e-3 * 3.5e-3 / math.sin(a) + 2 * 3.5e-3**2 / math.tan(a)


def test_one_measurement_serves_balls_of_several_sizes() -> None:
    chamber = slot(3.0)
    gaps = find_gaps(chamber, [2e-3, 3e-3, 4e-3])
    sizes = (2e-3, 2.5e-3, 2.72e-3, 3e-3, 3.3e-3, 3.5e-3, 4e-3)
    jams = [bool(jam_gaps(chamber, size, gaps)) for size in sizes]
    assert jams == [False, False, True, True, True, False, False]


def test_a_gap_that_no_ball_gets_near_jams_none() -> None:
    """A slot of a ball's width behind a neck of a third of it."""
    neck = trimesh.creation.box(bounds=[(-0.5, 0.0, 9.5), (0.5, 20.0, 15.0)])
    room = trimesh.creation.box(bounds=[(-1.5, 0.0, 14.9), (1.5, 20.0, 20.0)])
    chamber = cavity(ROOM, neck, room)
    assert jam_gaps(chamber, BALL)  # the slot alone is a gap
    assert not jam_gaps(chamber, BALL, gaps_in_reach(reached(chamber)))


def test_check_says_where_balls_jam_and_which_do_not() -> None:
    chamber = slot(2.982)  # 0.994 balls
    (found,) = gap_warnings(reached(chamber), chamber, [BALL])
    assert found.subject == (WarningKind.JAM, (PART_SIDE, PART_SIDE))
    assert found.text == (
        "balls of 3 mm can jam in the gap of the part's side at (0.0, 10.2, 12.3) mm in the "
        "chamber's frame, 2.98 mm wide there, on 46 % of the target; use balls below 2.59 mm or "
        "above 3.32 mm, or close it where it is not to be peened"
    )
    (locks,) = gap_warnings(reached(wedge(10.0)), wedge(10.0), [BALL])
    assert "2.7 to 3.44 mm wide there" in locks.text
    assert "use balls" not in locks.text
