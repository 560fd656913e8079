"""Residual stress under a peened surface: from one dent to an eigenstrain, from that to stress.

An eigenstrain is the strain that a layer would keep if nothing held it. Held by the metal below,
it is stress. Compression is negative.

Notation
    z       depth below the surface [m]                              (depth, (n,))
    D, R    diameter and radius of the ball [m]                      (ball)
    v, rho  normal speed [m/s] and density [kg/m³] of the ball       (speed, density)
    d       diameter of its dent on the part [m]                     (dent)
    E, nu   elasticity of the part, E* contact modulus with the ball [Pa]
    Y, U    yield and tensile strength of the part [Pa]
    a, p0   radius [m] and largest pressure [Pa] of the elastic contact
    A       z / a
    se, sp  equivalent stress of the elastic contact, and after yielding [Pa]
    P       compressive stress that the impact leaves in a thick part [Pa]
    w       share of P that is left near the free surface
    e       eigenstrain, e in both directions of the surface         (eigenstrain)
    H       thickness of a plate [m]; k its curvature [1/m]

    a = R (1.25 pi rho v² / E*)^0.2,  p0 = 2 E* a / (pi R)
    sz = -p0 / (1 + A²),  sr = -p0 ((1 + nu) (1 - A atan(1 / A)) - 0.5 / (1 + A²)),  se = |sz - sr|
    h  = (U - Y) / (0.1 - Y / E),  alpha = max(1, d / (2 a))
    sp = min(Y + h alpha (se - Y) / E, U)                           where se > Y
    Q  = (se - sp) / 3, or (sp + h alpha (se - 2 sp) / E) / 3 where se > 2 sp
    P  = Q (1 + nu) / (1 - nu)

The depth is scaled so that P ends at 1.25 d, and P does not fall towards the surface. The share w
grows as half a cosine from 0.75 at the surface to 1 at the depth of the largest P, and at 0.35 of
the layer at least. These two numbers, 1.25 and 0.75, were chosen so that published profiles are met
(docs/explanation/residual_stress.md). Each kind of profile can be moved by a factor that a measured
profile of the metal gives (LawFactors).

    thick part   stress = -E e / (1 - nu)
    plate        k = 12 / H³ integral of e (H/2 - z)
                 stress = E / (1 - nu) (integral of e / H + k (H/2 - z) - e),  k = 0 if held flat;
                 peened on both sides, twice the integral and k = 0

Source: J. K. Li, M. Yao, D. Wang and R. Wang, "Mechanical approach to the residual stress field
induced by shot peening", Mater. Sci. Eng. A147 (1991) 167. The plate: forces and moments balance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from chamberopt.design.flexure import PlateKind
from chamberopt.design.materials.catalogue import Elastic

OF_DENT = 1.25  # depth of compression over the diameter of the dent
AT_SURFACE = 0.75  # w at z = 0
FULL_AT = 0.35  # least depth at which w is 1, over the depth of compression
UNIFORM_STRAIN = 0.1  # strain at which the tensile strength is reached
GRID = 257  # depths in the layer of one dent; twice as many change no stress by 0.1 %
HALVINGS = 60
# Lengths between which the gauge of SAE J442 reads an arc height [m]: half along, half across.
GAUGE = 15.875e-3, 7.94e-3


class PeenedMetal(NamedTuple):
    """Strength [Pa] and elasticity of a part, with the contact modulus E* [Pa] of ball on part."""

    elastic: Elastic
    yield_strength: float
    tensile_strength: float
    contact_modulus: float

    @property
    def biaxial_modulus(self) -> float:
        """E / (1 - nu) [Pa], the stress of a layer over its held strain."""
        return self.elastic.modulus / (1.0 - self.elastic.poisson)


class LawFactors(NamedTuple):
    """Factors on the law for one metal: on depths, on the largest stress and at the surface."""

    depth: float = 1.0
    peak: float = 1.0
    surface: float = 1.0


class Plate(NamedTuple):
    """A flat part of finite thickness [m]: peened on one side, and free to bend or held flat, or
    peened alike on both sides.
    """

    thickness: float
    peened: PlateKind = "one_side"


AS_IS = LawFactors()


def eigenstrain_under_dents(
    depth: np.ndarray,
    dent: np.ndarray,
    speed: np.ndarray,
    ball: tuple[float, float],
    metal: PeenedMetal,
    factors: LawFactors = AS_IS,
) -> np.ndarray:
    """Return the eigenstrain at each depth if dents of one size cover the whole surface, (k, n).

    Args:
        depth: z [m], (n,).
        dent: diameters d of the dents [m], (k,). A diameter of 0 leaves nothing.
        speed: normal speeds that leave them [m/s], (k,).
        ball: diameter [m] and density [kg/m³] of the ball.
        factors: of a calibration to measured profiles.
    """
    rows = [
        _under_dent(depth, float(d), float(v), ball, metal, factors)
        for d, v in zip(dent, speed, strict=True)
    ]
    return np.array(rows).reshape(len(rows), len(depth))


def _under_dent(
    depth: np.ndarray,
    dent: float,
    speed: float,
    ball: tuple[float, float],
    metal: PeenedMetal,
    factors: LawFactors,
) -> np.ndarray:
    diameter, density = ball
    radius, nu, modulus = 0.5 * diameter, metal.elastic.poisson, metal.elastic.modulus
    contact = radius * (1.25 * np.pi * density * speed**2 / metal.contact_modulus) ** 0.2
    pressure = 2.0 * metal.contact_modulus * contact / (np.pi * radius)
    end = _end_of_yielding(pressure, metal)
    if not (dent > 0.0 and end > 0.0):
        return np.zeros(len(depth))
    share = np.linspace(0.0, 1.0, GRID)  # depth over the depth of compression
    elastic = pressure * _equivalent(share * end, nu)
    y, u = metal.yield_strength, metal.tensile_strength
    slope = (u - y) / (UNIFORM_STRAIN - y / modulus) / modulus * max(1.0, 0.5 * dent / contact)
    flow = np.where(elastic > y, np.minimum(y + slope * (elastic - y), u), elastic)
    again = np.where(elastic > 2.0 * flow, flow + slope * (elastic - 2.0 * flow), elastic - flow)
    stress = again / 3.0 * (1.0 + nu) / (1.0 - nu)
    full = max(FULL_AT, float(share[stress.argmax()]))
    stress = np.maximum.accumulate(stress[::-1])[::-1]
    # with factors it may be more than 1, and the stress largest at the surface
    first = AT_SURFACE * factors.surface / factors.peak
    near = first + (1.0 - first) * 0.5 * (1.0 - np.cos(np.pi * np.minimum(share / full, 1.0)))
    strain = factors.peak * stress * near / metal.biaxial_modulus
    layer = OF_DENT * dent * factors.depth
    return np.asarray(np.interp(depth / layer, share, strain, right=0.0))


def _equivalent(ratio: np.ndarray, poisson: float) -> np.ndarray:
    """Return the equivalent stress of the elastic contact over p0, at depths z / a."""
    inverse = np.arctan2(1.0, ratio)  # atan(1 / A), also for A = 0
    along = 1.0 / (1.0 + ratio**2)
    across = (1.0 + poisson) * (1.0 - ratio * inverse) - 0.5 * along
    return np.asarray(np.abs(along - across))


def _end_of_yielding(pressure: float, metal: PeenedMetal) -> float:
    """Return the depth z / a below which the contact stays elastic; 0 if all of it does."""
    low, high = 0.48, 1e4  # the equivalent stress is largest near 0.48 a and falls below
    nu, wanted = metal.elastic.poisson, metal.yield_strength / pressure
    if _equivalent(np.array([low]), nu)[0] <= wanted:
        return 0.0
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        yields = _equivalent(np.array([middle]), nu)[0] > wanted
        low, high = (middle, high) if yields else (low, middle)
    return float(low)


def integrals(depth: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the integrals of values and of values times depth over the depth, (...) each.

    They are exact for values (..., n) that are straight lines between the depths (n,).
    """
    width = np.diff(depth)
    above, below, z0, z1 = values[..., :-1], values[..., 1:], depth[:-1], depth[1:]
    first = (width * (above + below) / 2.0).sum(axis=-1)
    moment = above * (2.0 * z0 + z1) + below * (z0 + 2.0 * z1)
    return first, (width * moment / 6.0).sum(axis=-1)


def bending(depth: np.ndarray, eigenstrain: np.ndarray, thickness: float) -> np.ndarray:
    """Return the curvature k [1/m] of a free plate with this eigenstrain on one side, (...).

    Args:
        depth: z [m], (n,). The eigenstrain (..., n) ends there.
    """
    whole, moment = integrals(depth, eigenstrain)
    return np.asarray(12.0 / thickness**3 * (0.5 * thickness * whole - moment))


def residual_stress(
    depth: np.ndarray, eigenstrain: np.ndarray, metal: PeenedMetal, plate: Plate | None = None
) -> np.ndarray:
    """Return the stress [Pa] at each depth of a thick part, or of a plate, (..., n).

    Args:
        depth: z [m], (n,). The eigenstrain (..., n) ends there, above the middle of a plate.
    """
    if plate is None:
        return np.asarray(-metal.biaxial_modulus * eigenstrain)
    height = plate.thickness
    whole, _ = integrals(depth, eigenstrain)
    held = np.asarray(whole / height)[..., None]
    if plate.peened == "one_side":
        curvature = bending(depth, eigenstrain, height)[..., None]
        held = held + curvature * (0.5 * height - depth)
    elif plate.peened == "both_sides":
        held = 2.0 * held
    return np.asarray(metal.biaxial_modulus * (held - eigenstrain))


def arc_height(depth: np.ndarray, eigenstrain: np.ndarray, thickness: float) -> float:
    """Return the arc height [m] that the gauge of SAE J442 reads on a strip of this thickness."""
    along, across = GAUGE
    return float(bending(depth, eigenstrain, thickness)) * (along**2 + across**2) / 2.0
