"""Coarse facets of solids whose surface is known: the divided surface is nearer to it.

Distances are stated in those of the facets themselves, so bounds hold for any size.
"""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.triangles import unit_vectors
from tests.chamberopt.geometry.smoothing.measures import (
    errors_before_and_after,
    require_sound,
    smoothed,
)
from tests.helpers.scenes.rounded_solids import Mesh, Outline, Solid, circle, outline, staggered

BALL = 1e-3  # radius [m]


def fillet_outline(radius: float) -> Outline:
    """An L with a hollow fillet and convex rounds of two ball radii."""
    r = BALL
    return outline(
        [(0, 0), (20 * r, 0), (20 * r, 5 * r, 2 * r), (8 * r, 5 * r, radius),
         (8 * r, 15 * r, 2 * r), (0, 15 * r)]
    )  # fmt: skip


def turned_outline(radius: float) -> Outline:
    """A stepped shaft, all edges rounded, with a hollow fillet."""
    r = BALL
    return outline(
        [(0, 0), (12 * r, 0, 2 * r), (12 * r, 5 * r, 2 * r), (6 * r, 5 * r, radius),
         (6 * r, 15 * r, 2 * r), (0, 15 * r)]
    )  # fmt: skip


CYLINDER = Solid(circle(5 * BALL), 10 * BALL)
BLOCKS = {times: Solid(fillet_outline(times * BALL), 10 * BALL) for times in (1.0, 1.5, 3.0)}
SHAFT = Solid(turned_outline(1.5 * BALL))
TORUS = Solid(circle(3 * BALL, 10 * BALL))
HALF_DISC = [(0, -5), (5, -5, 5), (5, 5, 5), (0, 5)]
SPHERE = Solid(outline([tuple(BALL * one for one in corner) for corner in HALF_DISC]))
SOLIDS = {
    "cylinder": CYLINDER,
    **{f"block, R = {times:g} r": one for times, one in BLOCKS.items()},
    "shaft": SHAFT,
    "torus": TORUS,
    "sphere": SPHERE,
}
FRUSTUM = Solid(outline([(0, 0), (8e-3, 0), (4e-3, 10e-3), (0, 10e-3)]))


def halvings(degrees: float, limit: float = 6.0) -> int:
    """How often facets are halved until they turn by no more than the limit."""
    return max(0, int(np.ceil(np.log2(degrees / limit) - 0.03)))


@pytest.mark.parametrize("degrees", [10.0, 15.0, 22.5, 30.0])
@pytest.mark.parametrize("name", SOLIDS)
def test_strips(name: str, degrees: float) -> None:
    """A facet halved n times is off by a quarter of its sagitta to the nth, and little more."""
    before, after = errors_before_and_after(SOLIDS[name], SOLIDS[name].strips(np.radians(degrees)))
    expected = 0.25 ** halvings(degrees)
    assert after.rms < (1.15 * expected + 0.06) * before.rms
    assert after.largest <= before.largest
    assert after.normals < 0.35 * before.normals


def test_fine_facets_are_left() -> None:
    mesh = CYLINDER.strips(np.radians(5.0))
    assert len(smoothed(mesh).finer.triangles) == len(mesh[1])


@pytest.mark.parametrize(
    ("name", "degrees", "rms", "normals"),
    [
        ("cylinder", 15.0, 0.25, 0.3),
        ("cylinder", 22.5, 0.15, 0.15),
        ("frustum", 15.0, 0.25, 0.3),
        ("frustum", 30.0, 0.15, 0.3),
        ("block, R = 1 r", 15.0, 0.31, 0.3),
        ("block, R = 1.5 r", 22.5, 0.15, 0.15),
        ("block, R = 3 r", 30.0, 0.15, 0.15),
        ("torus", 22.5, 0.2, 0.2),
        ("sphere", 15.0, 0.15, 0.1),
    ],
)
def test_irregular_triangles(name: str, degrees: float, rms: float, normals: float) -> None:
    solid = FRUSTUM if name == "frustum" else SOLIDS[name]
    before, after = errors_before_and_after(solid, solid.irregular(np.radians(degrees), 4e-3))
    assert after.rms < rms * before.rms
    assert after.largest < before.largest
    assert after.normals < normals * before.normals


@pytest.mark.parametrize("degrees", [10.0, 22.5, 30.0])
@pytest.mark.parametrize("times", BLOCKS)
def test_hollow_curvature(times: float, degrees: float) -> None:
    found = smoothed(BLOCKS[times].strips(np.radians(degrees))).found
    assert found.hollow.max() * times * BALL == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("subdivisions", [1, 2])
def test_sphere_of_even_triangles(subdivisions: int) -> None:
    """Facets of 20 to 30 degrees."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=5 * BALL)
    result = smoothed((np.asarray(ball.vertices), np.asarray(ball.faces)))
    require_sound(result)
    radius = np.linalg.norm(result.finer.vertices, axis=1)
    assert np.abs(radius / (5 * BALL) - 1.0).max() < 1e-3  # a tenth of the sagitta
    exact = unit_vectors(result.finer.vertices)[result.finer.triangles]
    cosine = (result.finer.normals * exact).sum(axis=2)
    assert np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max() < 0.5


@pytest.mark.parametrize("degrees", [15.0, 30.0])
def test_cone_keeps_its_apex(degrees: float) -> None:
    """New vertices lie on the cone, which stays a cone to its point."""
    cone = Solid(outline([(0, 0), (6 * BALL, 0), (0, 12 * BALL)]))
    mesh = cone.strips(np.radians(degrees))
    result = smoothed(mesh)
    require_sound(result)
    new = result.finer.vertices[len(mesh[0]) :]
    assert len(new) > len(mesh[0])
    sagitta = 6 * BALL * (1.0 - np.cos(np.radians(degrees / 2)))
    assert cone.nearest(new)[0].max() < 0.2 * sagitta


@pytest.mark.parametrize("count", [18, 24, 36])
@pytest.mark.parametrize(("top", "height"), [(8, 20), (5, 20), (2, 20), (5, 5), (7, 3), (1, 6)])
def test_frustums(top: float, height: float, count: int) -> None:
    """A cone's curvature grows towards its narrow end, over facets as long as the cone."""
    cone = Solid(outline([(0, 0), (10, 0), (top, height), (0, height)]))
    mesh = cone.strips(0.1, around=2.0 * np.pi / count)
    before, after = errors_before_and_after(cone, mesh)
    assert after.rms < 0.6 * before.rms
    assert after.largest < 0.6 * before.largest
    require_sound(smoothed(mesh))


@pytest.mark.parametrize("seed", [None, 1])
@pytest.mark.parametrize("count", [12, 18, 24])
@pytest.mark.parametrize(("high", "height"), [(8, 16), (4, 10)])
def test_even_triangles_in_rings(high: float, height: float, count: int, seed: int | None) -> None:
    """Facets of 30 to 15 degrees with valleys between, most of which are no evidence of a round."""
    solid = Solid(outline([(0, 0), (8, 0), (high, height), (0, height)]))
    rng = None if seed is None else np.random.default_rng(seed)
    mesh = staggered(8.0, high, height, count, rng)
    before, after = errors_before_and_after(solid, mesh)
    assert after.rms < 0.2 * before.rms
    assert after.largest < 0.4 * before.largest
    assert after.normals_usually < 0.4 * before.normals_usually
    result = smoothed(mesh)
    assert result.found.blunt == 0
    assert len(result.finer.triangles) < 40 * len(mesh[1])
    require_sound(result)


@pytest.mark.parametrize("degrees", [10.0, 15.0])
@pytest.mark.parametrize("chamfer", [30.0, 38.0])
def test_chamfer_in_irregular_triangles_stays_sharp(chamfer: float, degrees: float) -> None:
    """A round does not go on across the edge of a chamfer, but it does across other edges."""
    in_ = 2e-3 * np.tan(np.radians(chamfer))
    corners = [(0, 0), (6e-3 - in_, 0), (6e-3, 2e-3), (6e-3, 20e-3), (0, 20e-3)]
    shaft = Solid(outline(corners))
    before, after = errors_before_and_after(shaft, shaft.irregular(np.radians(degrees), 3e-3))
    assert after.rms < 0.4 * before.rms
    assert after.largest < 0.4 * before.largest


@pytest.mark.parametrize("chamfer", [15.0, 30.0, 38.0])
@pytest.mark.parametrize("degrees", [10.0, 22.5, 30.0])
def test_chamfer_of_a_shaft_stays_sharp(chamfer: float, degrees: float) -> None:
    """The facets round the shaft tell nothing of the edge at its end."""
    r, in_ = BALL, 2 * BALL * np.tan(np.radians(chamfer))
    shaft = Solid(outline([(0, 0), (6 * r - in_, 0), (6 * r, 2 * r), (6 * r, 20 * r), (0, 20 * r)]))
    result = smoothed(shaft.strips(np.radians(degrees)))
    sagitta = 6 * r * (1.0 - np.cos(np.radians(degrees / 2)))
    assert len(result.finer.triangles) > 2 * len(result.mesh[1])
    assert shaft.nearest(result.finer.vertices)[0].max() < 0.25 * sagitta


@pytest.mark.parametrize(
    "draw",
    [lambda: TORUS.strips(np.radians(15.0)), lambda: TORUS.irregular(np.radians(22.5), 4e-3)],
)
def test_saddles_become_few_triangles(draw: Callable[[], Mesh]) -> None:
    """Two halvings both ways make 16 of one, folds a few more; normals that go astray hundreds."""
    mesh = draw()
    assert len(smoothed(mesh).finer.triangles) < 18 * len(mesh[1])
