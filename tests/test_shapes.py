"""Parametric cavities against the solids they stand for."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from chamberopt.shapes import SHAPES, TAG_SONOTRODE, TAG_WALL
from chamberopt.shapes.cylinder import cylinder


@pytest.mark.parametrize("facets", [8, 9, 64, 1024])
def test_a_cylinder_is_the_prism_over_a_regular_polygon(facets: int) -> None:
    radius, height = 0.035, 0.045
    polygon = facets / 2 * radius**2 * np.sin(2 * np.pi / facets)

    surface = cylinder(SimpleNamespace(diameter=2 * radius, height=height, facets=facets))

    mesh = trimesh.Trimesh(surface.vertices, surface.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(polygon * height, rel=1e-12)
    assert len(surface.triangles) == 4 * facets
    floor = surface.tags == TAG_SONOTRODE
    assert mesh.area_faces[floor].sum() == pytest.approx(polygon, rel=1e-12)
    assert mesh.area_faces[surface.tags == TAG_WALL].sum() == pytest.approx(mesh.area - polygon, rel=1e-12)


def test_the_floor_is_at_zero_and_the_axis_does_not_drift() -> None:
    surface = cylinder(SimpleNamespace(diameter=0.07, height=0.045, facets=64))

    floor = surface.vertices[surface.triangles[surface.tags == TAG_SONOTRODE]]
    assert (floor[..., 2] == 0.0).all()
    assert np.abs(surface.vertices[:, :2].mean(axis=0)).max() < 1e-17
    assert np.allclose(np.hypot(*surface.vertices[:128, :2].T), 0.035, rtol=1e-15)
    assert surface.vertices[:, 2].max() == 0.045


def test_every_shape_of_a_design_is_registered() -> None:
    from typing import get_args

    from chamberopt.config import Design

    named = Design.model_fields["chamber"].annotation.model_fields["shape"].annotation
    assert set(get_args(named)) == set(SHAPES)
