"""The law of residual stress: balances of force and moment, limits, and a worked case."""

import numpy as np
import pytest

from chamberopt.coverage.stress_law import (
    AS_IS,
    AT_SURFACE,
    OF_DENT,
    LawFactors,
    PeenedMetal,
    Plate,
    arc_height,
    bending,
    eigenstrain_under_dents,
    integrals,
    residual_stress,
)
from chamberopt.design.materials import alloy, ball
from chamberopt.design.materials.catalogue import Elastic

ALUMINIUM, SHOT = Elastic(71.7e9, 0.33), Elastic(205e9, 0.29)
METAL = PeenedMetal(ALUMINIUM, 470e6, 525e6, 1.0 / (ALUMINIUM.compliance + SHOT.compliance))
BALL = 0.58e-3, 7600.0
DENT = 198e-6
END = OF_DENT * DENT
DEPTH = np.linspace(0.0, END, 400)


def profile(factors: LawFactors = AS_IS, dent: float = DENT) -> np.ndarray:
    strain = eigenstrain_under_dents(
        DEPTH, np.array([dent]), np.array([30.0]), BALL, METAL, factors
    )
    return strain[0]


def test_a_case_that_was_worked_out_elsewhere() -> None:
    """7050-T7451 under S230 of .2 mmA: -285, -347 MPa at 74 µm, to 1.25 d (an own program)."""
    stress = residual_stress(DEPTH, profile(), METAL) / 1e6
    assert stress[0] == pytest.approx(-285.5, abs=1.0)
    assert stress.min() == pytest.approx(-347.2, abs=1.0)
    assert 1e6 * DEPTH[stress.argmin()] == pytest.approx(74.0, abs=2.0)
    assert stress[-1] == pytest.approx(0.0, abs=1e-6)
    assert stress[-20] < 0.0


def test_contact_stress_is_that_of_hertz() -> None:
    """Largest shear of a sphere on a half-space, nu = 0.3: 0.31 p0 at 0.48 a (K. L. Johnson)."""
    from chamberopt.coverage.stress_law import _equivalent

    ratio = np.linspace(0.0, 2.0, 2001)
    shear = 0.5 * _equivalent(ratio, 0.3)
    assert shear.max() == pytest.approx(0.310, abs=0.001)
    assert ratio[shear.argmax()] == pytest.approx(0.48, abs=0.01)


@pytest.mark.parametrize("thickness", [1.29e-3, 5e-3])
def test_force_and_moment_of_a_free_plate_balance(thickness: float) -> None:
    depth, strain = np.append(DEPTH, thickness), np.append(profile(), 0.0)
    stress = residual_stress(depth, strain, METAL, Plate(thickness))
    force, moment = integrals(depth, stress)
    size, _ = integrals(depth, np.abs(stress))
    assert abs(force) < 1e-6 * size
    assert abs(moment) < 1e-6 * size * thickness


def test_force_of_a_plate_peened_on_both_sides_balances() -> None:
    """Half of its thickness holds one layer, and half of the force of both is in it."""
    thickness = 2e-3
    depth, strain = np.append(DEPTH, thickness / 2.0), np.append(profile(), 0.0)
    stress = residual_stress(depth, strain, METAL, Plate(thickness, "both_sides"))
    force, _ = integrals(depth, stress)
    assert abs(force) < 1e-6 * integrals(depth, np.abs(stress))[0]


def test_a_plate_held_flat_keeps_a_force_of_none_and_a_moment() -> None:
    thickness = 2e-3
    depth, strain = np.append(DEPTH, thickness), np.append(profile(), 0.0)
    stress = residual_stress(depth, strain, METAL, Plate(thickness, "held_flat"))
    force, moment = integrals(depth, stress)
    size = integrals(depth, np.abs(stress))[0]
    assert abs(force) < 1e-6 * size
    assert abs(moment) > 0.1 * size * END


def test_a_thick_plate_has_the_stress_of_a_thick_part() -> None:
    thick, strain = residual_stress(DEPTH, profile(), METAL), profile()
    for kind in ("one_side", "held_flat", "both_sides"):
        plate = residual_stress(DEPTH, strain, METAL, Plate(1.0, kind))
        assert plate == pytest.approx(thick, abs=2e-3 * abs(thick.min()))


def test_a_layer_as_deep_as_the_plate_leaves_no_stress() -> None:
    """An even eigenstrain over all of a thin strip stretches it, and nothing holds it."""
    depth = np.linspace(0.0, 1e-3, 11)
    even = np.full(11, 1e-3)
    assert residual_stress(depth, even, METAL, Plate(1e-3)) == pytest.approx(np.zeros(11), abs=1.0)
    assert bending(depth, even, 1e-3) == pytest.approx(0.0, abs=1e-9)


def test_arc_heights_of_thin_layers_go_with_the_inverse_square_of_the_thickness() -> None:
    depth, strain = np.array([0.0, 1e-6]), np.array([1e-2, 1e-2])
    n, a, c = (arc_height(depth, strain, h) for h in (0.79e-3, 1.29e-3, 2.39e-3))
    assert n / a == pytest.approx((1.29 / 0.79) ** 2, rel=2e-3)
    assert a / c == pytest.approx((2.39 / 1.29) ** 2, rel=2e-3)
    # k = 6 e t / H² for a layer of thickness t at the surface (G. G. Stoney, 1909)
    curvature = 6.0 * 1e-2 * 1e-6 / 1.29e-3**2
    assert a == pytest.approx(curvature * (15.875e-3**2 + 7.94e-3**2) / 2.0, rel=2e-3)


def test_factors_move_depth_peak_and_surface_alone() -> None:
    plain = residual_stress(DEPTH, profile(), METAL)
    weak = residual_stress(DEPTH, profile(LawFactors(surface=0.8)), METAL)
    assert weak[0] == pytest.approx(0.8 * plain[0])
    assert weak.min() == pytest.approx(plain.min(), rel=0.01)
    strong = residual_stress(DEPTH, profile(LawFactors(peak=1.2)), METAL)
    assert strong[0] == pytest.approx(plain[0])
    assert strong.min() == pytest.approx(1.2 * plain.min(), rel=0.03)
    shallow = profile(LawFactors(depth=0.8))
    assert shallow == pytest.approx(np.interp(DEPTH / 0.8, DEPTH, profile(), right=0.0), abs=3e-6)
    hard = residual_stress(DEPTH, profile(LawFactors(surface=2.0)), METAL)
    assert hard.min() == hard[0] == pytest.approx(2.0 * plain[0])


def test_no_stress_passes_the_tensile_strength() -> None:
    """Li's law saturates near 0.6 of the flow stress, 0.7 of it on aluminium, at any speed."""
    for name in ("Ti-6Al-4V", "IN718", "7075-T6", "42CrMo4"):
        part, steel = alloy(name), ball("steel").elastic
        metal = PeenedMetal(
            part.elastic, 1e6 * part.yield_MPa, 1e6 * part.tensile_MPa,
            1.0 / (part.elastic.compliance + steel.compliance),
        )  # fmt: skip
        peaks = []
        for speed in (3.0, 10.0, 30.0):
            strain = eigenstrain_under_dents(
                DEPTH, np.array([DENT]), np.array([speed]), (3e-3, 7800.0), metal
            )
            peaks.append(-residual_stress(DEPTH, strain, metal).min() / metal.tensile_strength)
        assert 0.45 < min(peaks) <= max(peaks) < 0.75


def test_an_elastic_contact_leaves_nothing() -> None:
    nothing = eigenstrain_under_dents(
        DEPTH, np.array([0.0, DENT]), np.array([30.0, 1e-6]), BALL, METAL
    )
    assert not nothing.any()
    assert AT_SURFACE < 1.0
