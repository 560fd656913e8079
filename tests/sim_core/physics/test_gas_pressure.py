"""The pressure of an elastic gas on its walls, and how often its balls meet, against the theory of
hard spheres.

V is the volume the centres can reach, (side - diameter)³. A cube of a thousand balls is mostly near
its walls: at φ = 0.3 they lower pV/NkT by a fifth, which is why the theory has a surface term and
two sizes are compared.
"""

import numpy as np
import pytest

from tests.helpers.scenes.gas import (
    DIAMETER,
    EFFORT,
    LARGE,
    SURE,
    carnahan_starling,
    gas_over_theory,
    jackknife,
    measured,
)

PACKINGS = [0.02, 0.1, 0.2, 0.3]


def compare_with_theory(packing: float, effort: int) -> None:
    for name, (ratio, error, allowed) in gas_over_theory(packing, effort).items():
        print(f"packing {packing}: {name} over theory {ratio:.4f} +- {error:.4f}")
        assert abs(ratio - 1.0) < allowed + SURE * error, name


@pytest.mark.parametrize("packing", PACKINGS)
def test_pressure_and_collision_rate(packing: float) -> None:
    compare_with_theory(packing, EFFORT)


@pytest.mark.parametrize("packing", PACKINGS)
def test_the_virial_theorem_ties_the_walls_impulses_to_the_collisions(packing: float) -> None:
    """3 p V = 2 E + Σ impulse × diameter over the collisions of a time: exact, for any number of
    balls, of any size.

    The closing speeds of pairs that meet average sqrt(π kT), as kT = <v²>/3 (1 + 1/12N, which is
    left out).
    """
    gas, rows = measured(LARGE, packing, EFFORT)
    virial, error = jackknife(
        lambda row: row[0] - 1.0 - row[1] * DIAMETER * np.sqrt(np.pi / gas.kt) / 6.0, rows
    )
    print(f"packing {packing}: virial {virial:.5f} +- {error:.5f}")
    assert abs(virial) < SURE * error + (carnahan_starling(packing) - 1.0) / (12.0 * LARGE**3)


@pytest.mark.long
@pytest.mark.parametrize("packing", PACKINGS)
def test_the_same_over_ten_times_as_many_collisions(packing: float) -> None:
    compare_with_theory(packing, 10 * EFFORT)
