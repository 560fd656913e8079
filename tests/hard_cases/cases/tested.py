"""Hard cases that are tests of their own, as lines of the table.

Counts are those of the runs of the test; the overlap is that at their ends.
"""

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np

from sim_core.loop.simulate import Simulation
from sim_core.scene.invariants import clearance, closest_pair
from tests.hard_cases.outcome import Case, Outcome
from tests.sim_core.contact import test_ball_on_ball as ball_on_ball
from tests.sim_core.contact import test_landing_and_lift_off as support_changes
from tests.sim_core.contact import test_path_end as path_end
from tests.sim_core.contact import test_pushed_by_part as pushed_by_part
from tests.sim_core.contact import test_resting_balls as resting_balls
from tests.sim_core.contact import test_rolling_friction as rolling
from tests.sim_core.geometry import test_turning_part as turning


@contextmanager
def runs_seen() -> Iterator[list[Simulation]]:
    """Every run that begins meanwhile."""
    seen: list[Simulation] = []
    begin = Simulation.__init__

    def begin_seen(run: Simulation, *scene: object) -> None:
        begin(run, *scene)  # type: ignore[arg-type]
        seen.append(run)

    with mock.patch.object(Simulation, "__init__", begin_seen):
        yield seen


def overlap(run: Simulation) -> float:
    """How deep a ball lies in another ball, or in a surface that neither vibrates nor turns [m]."""
    balls, physics, mesh = run.balls(), run.scene.physics, run.scene.mesh
    moving = [
        effect.tag for effect in (*physics.vibrations, physics.part_rotation) if effect is not None
    ]
    still = mesh.corners[~np.isin(mesh.tags, moving)]
    deepest = (
        balls.radius - clearance(still, balls.positions, 2.0 * balls.radius).min()
        if len(still)
        else -np.inf
    )
    return float(max(deepest, balls.diameter - closest_pair(balls)[0]))


def outcome_of_test(test: Callable[..., None], *arguments: object) -> Outcome:
    """Passed or not, and what it cost."""
    with runs_seen() as runs:
        try:
            test(*arguments)
        except AssertionError as error:
            said = (
                "not as physics demands: "
                f"{str(error).splitlines()[0] if str(error) else test.__name__}"
            )
        else:
            said = ""
    collisions = sum(int(run.state.counts[:3].sum()) for run in runs)
    seconds = sum(run.time for run in runs)
    events = collisions + sum(int(run.state.counts[4]) for run in runs)
    return Outcome(
        "",
        not said,
        said or "as the closed form or the conserved quantity says",
        collisions,
        events / seconds if seconds else 0.0,
        max(map(overlap, runs), default=float("nan")),
    )


def tested(name: str, test: Callable[..., None], *arguments: object) -> Case:
    """A test, called with these parameters, as a case."""
    inspect.signature(test).bind(
        *arguments
    )  # a call that cannot be is found when the table is made
    return Case(name, functools.partial(outcome_of_test, test, *arguments))


CASES = [
    tested(
        "bouncing to rest, e = 0.5",
        support_changes.test_a_dropped_ball_stops_when_the_series_of_its_bounces_ends,
        0.5,
    ),
    tested(
        "bouncing to rest, e = 0.9",
        support_changes.test_a_dropped_ball_stops_when_the_series_of_its_bounces_ends,
        0.9,
    ),
    tested("at rest", support_changes.test_a_ball_at_rest_costs_nothing),
    tested(
        "down a ramp of triangles",
        support_changes.test_down_a_ramp_of_many_triangles_it_slides_as_on_one,
        6,
        0.0,
    ),
    tested(
        "down a ramp with resistance",
        support_changes.test_down_a_ramp_of_many_triangles_it_slides_as_on_one,
        6,
        0.1,
    ),
    tested(
        "held on a gentle slope",
        path_end.test_resistance_stops_a_sliding_ball_and_holds_it_on_a_gentle_slope,
    ),
    *(
        tested(
            f"down a ramp, mu = {mu:g}",
            rolling.test_down_a_ramp_of_many_triangles_it_rolls_or_slips,
            mu,
            0.0,
            6,
        )
        for mu in (0.0, 0.05, 10.0)
    ),
    *(
        tested(
            f"landing with mu = {mu:g}",
            rolling.test_landing_it_rolls_in_the_end_with_what_the_floor_leaves_it,
            mu,
        )
        for mu in (0.01, 10.0)
    ),
    *(
        tested(
            f"slip turns on a slope, {speed:g} m/s",
            rolling.test_on_a_slope_a_slip_that_turns_is_followed,
            speed,
        )
        for speed in (0.4, 4.0)
    ),
    tested("rolling down a valley", rolling.test_down_a_valley_it_rolls_on_both_faces, 10.0),
    tested(
        "rolling over an edge", rolling.test_slowly_over_an_edge_it_rolls_until_it_leaves_it, 0.05
    ),
    tested(
        "held on a slope by friction",
        rolling.test_on_a_slope_it_lies_still_where_neither_slip_nor_roll_moves_it,
        0.37,
        0.27,
        True,
    ),
    tested("lift-off at a ramp's end", path_end.test_it_lifts_off_at_the_ramps_end),
    tested(
        "slowly over an edge", path_end.test_slowly_over_an_edge_it_rolls_until_it_leaves_it, 0.05
    ),
    tested(
        "change of slope",
        support_changes.test_over_a_gentle_change_of_slope_it_keeps_its_energy,
        20.0,
        8.0,
    ),
    tested("trough of 2 degree facets", support_changes.test_a_trough_of_facets_is_a_pendulum, 2.0),
    tested(
        "trough of 0.5 degree facets", support_changes.test_a_trough_of_facets_is_a_pendulum, 0.5
    ),
    tested("bowl of triangles", support_changes.test_a_bowl_of_triangles_keeps_the_energy),
    tested("down a valley", support_changes.test_down_a_valley_it_is_led_by_both_faces, 0.0),
    tested("wedged against three", support_changes.test_wedged_against_three_faces_it_sleeps),
    *(
        tested(
            f"into a slot 2r + {gap:g} m",
            support_changes.test_in_a_slot_just_wider_than_itself_it_costs_a_bounded_number_of_events,
            gap,
        )
        for gap in (1e-9, 1e-7, 1e-5, 1e-3)
    ),
    tested("heap falls still", resting_balls.test_a_settling_heap_falls_still_and_is_reported),
    tested("woken by a hit", ball_on_ball.test_another_balls_hit_wakes_it),
    tested("no rest on the sonotrode", resting_balls.test_on_the_sonotrode_nothing_rests),
    *(
        tested(
            f"falls on a bar at {rpm:g} rpm",
            turning.test_a_falling_ball_meets_the_turning_bar_when_the_closed_form_says,
            rpm,
        )
        for rpm in (1.0, 100.0, 6000.0)
    ),
    tested(
        "thrown by a turning bar",
        turning.test_a_resting_ball_is_thrown_by_the_bar_as_by_a_heavy_moving_face,
        1.0,
    ),
    tested(
        "rotor keeps the Jacobi integral",
        turning.test_hits_on_a_steady_rotor_keep_the_jacobi_integral,
        60.0,
    ),
    tested(
        "shaft turns in its ceiling",
        turning.test_a_round_shaft_turns_where_it_goes_through_the_ceiling_and_balls_stay_in,
    ),
    *(
        tested(
            f"woken by a paddle at {rpm:g} rpm",
            pushed_by_part.test_a_sleeping_ball_is_woken_when_the_paddle_arrives,
            rpm,
        )
        for rpm in (0.1, 10.0)
    ),
    tested(
        "pushed by a paddle at 0.05 rpm",
        pushed_by_part.test_what_it_pushes_pushes_others_however_slowly,
        0.05,
    ),
    tested(
        "pile swept at 1 rpm",
        pushed_by_part.test_a_pile_swept_by_a_slow_paddle_gets_no_more_speed_than_that_gives,
        1.0,
    ),
    tested(
        "at rest below a turning gear",
        pushed_by_part.test_balls_rest_below_a_gear_that_turns_and_nothing_overlaps,
    ),
    tested(
        "hops on a turning slab",
        pushed_by_part.test_on_the_turning_part_nothing_rests_and_hops_are_bounded,
    ),
    tested(
        "crushed by a cam",
        pushed_by_part.test_a_ball_that_the_part_crushes_stops_the_run_and_the_part_is_named,
    ),
]
