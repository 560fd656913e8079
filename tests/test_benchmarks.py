"""The structures that the benchmarks compare answer alike; how fast they are is not asked here."""

import numpy as np
import trimesh

from benchmarks import flights, wall_query, who_meets_whom
from benchmarks.gas import sample_gas
from benchmarks.scenes import DIAMETER
from benchmarks.structures.shell import build_shell
from sim_core.blocks import MANY
from tests.cavities import box_around

FLIGHTS = 100


def test_all_structures_find_the_same_contacts() -> None:
    """In a room with a body: faces, edges and corners to be met."""
    mesh = box_around(trimesh.creation.icosphere(subdivisions=1, radius=0.012), 0.03)
    shell = build_shell(mesh, 0.5 * DIAMETER)
    asked = flights.sample(shell, np.array([0.0, 0.0, 0.02]), FLIGHTS, np.random.default_rng(2))
    contests = {}
    for label, structure in wall_query.STRUCTURES.items():
        if structure.exact or label == wall_query.PRODUCT:
            answers = np.empty(FLIGHTS), np.empty(FLIGHTS, dtype=np.int64)
            contests[label] = wall_query.Contest(structure, structure.build(shell), asked, 1, *answers)
            contests[label].turn()
    assert len(contests) == 6
    wall_query.require_agreement(shell, contests)
    assert np.isfinite(contests[wall_query.PRODUCT].delays).all(), "the chamber is closed: every flight ends"


def test_all_structures_find_the_same_meetings() -> None:
    gas = sample_gas(MANY, np.random.default_rng(3))
    answers = who_meets_whom.answers(gas)
    assert (answers[who_meets_whom.PRODUCT][1] >= 0).sum() > 100
    assert len(answers) == 4
    who_meets_whom.require_agreement(answers)
