"""Whatever is smoothed is a solid again: drawn solids, unions, thin walls, several bodies."""

from pathlib import Path
from tempfile import TemporaryDirectory

import manifold3d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.field.symmetry import find_symmetry
from chamberopt.design.load import load_design
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.smoothing.part import Rule, smooth
from tests.chamberopt.geometry.smoothing.measures import require_solid, require_sound, smoothed
from tests.helpers.mesh_files import write_stl
from tests.helpers.scenes.rounded_solids import Mesh, Solid, circle, outline

GEAR = Path(__file__).parents[4] / "designs/gear.toml"


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    """A stepped profile with rounds, drawn out or turned, in facets of 3 to 45 degrees."""
    steps = draw(st.integers(1, 3))
    x, y = draw(st.floats(8.0, 14.0)), 0.0
    corners: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0), (x, 0.0, draw(st.floats(0, 1)))]
    for _ in range(steps):
        y += draw(st.floats(2.5, 6.0))
        corners.append((x, y, draw(st.sampled_from([0.0, 0.5, 1.0]))))
        x *= draw(st.floats(0.3, 0.7))
        corners.append((x, y, draw(st.sampled_from([0.0, 0.3, 0.8]))))
    y += draw(st.floats(2.5, 6.0))
    corners += [(x, y, draw(st.sampled_from([0.0, 0.5]))), (0.0, y, 0.0)]
    height = draw(st.one_of(st.none(), st.floats(1.0, 20.0)))
    step = np.radians(draw(st.floats(3.0, 45.0)))
    around = np.radians(draw(st.floats(8.0, 45.0)))
    seed = draw(st.one_of(st.none(), st.integers(0, 99)))
    rng = None if seed is None else np.random.default_rng(seed)
    vertices, triangles = Solid(outline(corners), height).strips(step, around, rng)
    return 1e-3 * vertices, triangles


def few(count: int) -> settings:
    slow = [HealthCheck.too_slow]
    return settings(max_examples=count, deadline=None, suppress_health_check=slow, derandomize=True)


# Whole micrometres: bodies that are a picometre apart are refused when they are read.
shifts = st.tuples(*[st.integers(-6000, 6000).map(lambda micrometres: 1e-6 * micrometres)] * 3)


def united(one: Mesh, two: Mesh, shift: tuple[float, ...]) -> Mesh:
    return mesh_of(body(one) + body((two[0] + np.array(shift), two[1])))


@few(5)
@given(meshes())
def test_drawn_solids(mesh: Mesh) -> None:
    require_sound_part(mesh)


@few(3)
@given(meshes(), meshes(), shifts)
def test_unions(one: Mesh, two: Mesh, shift: tuple[float, ...]) -> None:
    require_sound_part(united(one, two, shift))


@pytest.mark.long
@few(60)
@given(meshes())
def test_many_drawn_solids(mesh: Mesh) -> None:
    require_sound_part(mesh)


@pytest.mark.long
@few(150)
@given(meshes(), meshes(), shifts)
def test_many_unions(one: Mesh, two: Mesh, shift: tuple[float, ...]) -> None:
    require_sound_part(united(one, two, shift))


@pytest.mark.parametrize("gap", [0.05e-3, 0.3e-3])
def test_thin_walls(gap: float) -> None:
    """A tube of 24 facets whose sagitta is more than its wall."""
    outer, inner = (Solid(circle(radius), 20e-3) for radius in (10e-3, 10e-3 - gap))
    wall = body(outer.strips(np.radians(15.0))) - body(inner.strips(np.radians(15.0)))
    require_sound_part(mesh_of(wall))


def test_several_bodies() -> None:
    """Two shafts apart become what each becomes alone."""
    vertices, triangles = Solid(circle(5e-3), 10e-3).strips(np.radians(15.0))
    alone = smoothed((vertices, triangles))
    both = smoothed(
        (
            np.concatenate([vertices, vertices + np.array([0.02, 0.0, 0.0])]),
            np.concatenate([triangles, triangles + len(vertices)]),
        )
    )
    require_sound(both)
    assert len(both.finer.triangles) == 2 * len(alone.finer.triangles)


def test_copies_stay_alike() -> None:
    """The gear with its rounds divided has the symmetry of its 20 teeth."""
    chamber = build_chamber(load_design(GEAR))
    assert chamber.part.smoothing is not None
    assert chamber.part.smoothing.largest_move > 1e-6
    found = find_symmetry(chamber, chamber_mesh(chamber))
    assert found is not None
    assert found.copies == 20


def body(mesh: Mesh) -> manifold3d.Manifold:
    return manifold3d.Manifold(
        manifold3d.Mesh64(np.ascontiguousarray(mesh[0]), mesh[1].astype(np.uint64))
    )


def require_sound_part(mesh: Mesh) -> None:
    """A file's part whose rounds are divided as a design asks for is sound."""
    vertices, triangles = mesh
    with TemporaryDirectory() as folder:
        part = read_part(write_stl(Path(folder) / "part.stl", 1e3 * vertices[triangles]), "mm")
    every = np.ones(len(part.triangles), dtype=bool)
    result = smooth(part, Rule(every, False, np.radians(6.0), 6e-5, np.inf), [])
    require_solid(
        (part.vertices, part.triangles),
        (result.vertices, result.triangles),
        result.origin,
        result.facts.largest_move,
    )


def mesh_of(solid: manifold3d.Manifold) -> Mesh:
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, dtype=np.int64)
