"""Notes on balls that hop on one spot or rattle in a gap: the shipped plate, and made-up balls."""

from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.part import Part
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.design.effects import FrictionTable
from chamberopt.results.records import TrappedRecord
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica
from chamberopt.simulation.trapped_balls import (
    NOT_TRAPPED,
    SHARES,
    TrappedBalls,
    find_trapped_balls,
    mean_trapped,
    trapped_notes,
)
from sim_core import Balls, Trapped
from tests.helpers.scenes.cavities import box_around
from tests.helpers.synthetic import plate_design

BALL = 3e-3  # m


def test_all_balls_of_few_end_hopping_and_the_note_says_so() -> None:
    """Between parallel faces friction leaves few balls no sideways speed, without friction it
    lasts.
    """
    plate = plate_design(process__accuracy__simulated_time_s=3.0)
    smooth = {"effects.friction": "none", "effects.roughness": "none"}
    plate = plate.changed({"shot.mass_g": 4e3 * plate.shot.ball_mass} | smooth)
    chamber = build_chamber(plate)
    rubs = plate.effects.model_copy(update={"friction": FrictionTable(mu=0.3, beta0=0.2)})
    setting = ReplicaSetting(plate, chamber, chamber_mesh(chamber))
    assert trapped_notes([simulate_replica(setting, replica_seed(1, 0)).trapped], plate) == ()

    setting = setting._replace(design=plate.model_copy(update={"effects": rubs}))
    found = simulate_replica(setting, replica_seed(1, 0)).trapped
    assert found.hopping_at_end == 1.0
    assert 0.9 < found.hopping_time <= 1.0
    assert 0.9 < found.hopping_impacts <= 1.0
    assert found.rattling_time == 0.0
    (note,) = trapped_notes([found], setting.design)
    assert "in 1 of 1 replicas balls hopped up and down on one spot" in note
    assert "at the end all balls did" in note
    assert "effects.roughness" in note
    assert TrappedRecord(**asdict(mean_trapped([found]))).hopping_at_end == 1.0


@pytest.fixture(scope="module")
def chamber() -> Chamber:
    """A room of 20 mm with a part of 13.94 mm between two walls: gaps of 3.03 mm at both ends."""
    mesh = box_around(trimesh.creation.box((13.94e-3, 8e-3, 8e-3)), 10e-3)
    part = Part(
        mesh.vertices, mesh.triangles, np.ones(len(mesh.triangles)), np.ones(1, dtype=bool), "box"
    )
    none = np.zeros(len(mesh.triangles), dtype=np.int32)
    return Chamber(mesh.vertices, mesh.triangles, mesh.tags, none, 1.0, part, none, ())


def result(impacts: int, trapped: Trapped) -> Any:
    places = np.zeros((10, 3))
    return SimpleNamespace(
        balls=Balls(places, places, BALL), trapped=trapped, impacts=range(impacts)
    )


def test_a_rattling_ball_is_counted_and_its_gap_named(chamber: Chamber) -> None:
    two = Trapped(
        ball=np.array([3, 7]),
        hopping=np.array([0.0, 0.5]),
        rattling=np.array([1.0, 0.0]),
        hopping_hits=np.array([0, 30]),
        rattling_hits=np.array([480, 0]),
        at_end=np.array([True, False]),
        position=np.array([[8.485e-3, 0.0, 0.0], [0.0, 0.0, 8e-3]]),
    )
    found = find_trapped_balls(result(520, two), 2.0, chamber, part_turns=False)
    assert found == TrappedBalls(
        hopping_time=0.025,
        hopping_impacts=0.03,
        hopping_at_end=0.0,
        rattling_time=0.05,
        rattling_impacts=0.48,
        rattling_balls=0.1,
        rattling_longest=0.5,
        place="between the part's side and the wall, around (8.5, 0.0, 0.0) mm",
    )
    plate = plate_design(process__accuracy__simulated_time_s=2.0)
    plate = plate.changed({"shot.mass_g": 1e4 * plate.shot.ball_mass})
    hops, rattles = trapped_notes([found, NOT_TRAPPED, found], plate)
    assert "in 2 of 3 replicas balls hopped" in hops
    assert "at the end" not in hops
    assert "shot.mass_g" in hops
    assert rattles == (
        "0.67 of 10 balls are held or rattle in gaps hardly wider than themselves, the longest "
        "one for 0.67 of 2 s: the shot loses 3.3 % of its time, and 32 % of all impacts on the "
        "part are those of held balls, which count in no figure; e.g. between the part's side "
        "and the wall, around (8.5, 0.0, 0.0) mm in the chamber's frame; give another "
        "shot.diameter_mm than the gap, or close it"
    )
    turned = find_trapped_balls(result(520, two), 2.0, chamber, part_turns=True)
    assert turned.place == "at the wall, around (8.5, 0.0, 0.0) mm"


def test_a_few_hops_change_no_figure_and_make_no_note() -> None:
    few = TrappedBalls(0.002, 0.004, 0.0, 0.0, 0.001, 0.1, 0.004, "")
    assert trapped_notes([few, NOT_TRAPPED], plate_design()) == ()
    assert trapped_notes([], plate_design()) == ()
    assert mean_trapped([]) is None
    assert mean_trapped([few]) == few
    assert (*SHARES, "place") == tuple(TrappedRecord.model_fields)
