"""Parametric cavities against the solids they stand for."""

import numpy as np
import pytest
import trimesh

from chamberopt.shapes import SHAPES, TAG_SONOTRODE, TAG_WALL
from chamberopt.shapes.cylinder import Cylinder
from chamberopt.shapes.surface import ShapeSurface

NOTHING = np.zeros((0, 3)), np.zeros((0, 3), dtype=int)


def cylinder(diameter_mm: float, height_mm: float, facets: int) -> ShapeSurface:
    table = Cylinder(
        shape="cylinder", sonotrode_distance_mm=15.0, diameter_mm=diameter_mm, height_mm=height_mm, facets=facets
    )
    return table.surface(*NOTHING)


@pytest.mark.parametrize("facets", [8, 9, 64, 1024])
def test_a_cylinder_is_the_prism_over_a_regular_polygon(facets: int) -> None:
    radius, height = 0.035, 0.045
    polygon = facets / 2 * radius**2 * np.sin(2 * np.pi / facets)

    surface = cylinder(2e3 * radius, 1e3 * height, facets)

    mesh = trimesh.Trimesh(surface.vertices, surface.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(polygon * height, rel=1e-12)
    assert len(surface.triangles) == 4 * facets
    floor = surface.tags == TAG_SONOTRODE
    assert mesh.area_faces[floor].sum() == pytest.approx(polygon, rel=1e-12)
    assert mesh.area_faces[surface.tags == TAG_WALL].sum() == pytest.approx(mesh.area - polygon, rel=1e-12)


def test_the_floor_is_at_zero_and_the_axis_does_not_drift() -> None:
    surface = cylinder(70.0, 45.0, 64)

    floor = surface.vertices[surface.triangles[surface.tags == TAG_SONOTRODE]]
    assert (floor[..., 2] == 0.0).all()
    assert np.abs(surface.vertices[:, :2].mean(axis=0)).max() < 1e-17
    assert np.allclose(np.hypot(*surface.vertices[:128, :2].T), 0.035, rtol=1e-15)
    assert surface.vertices[:, 2].max() == 0.045


def test_every_shape_has_its_name_and_a_table_of_its_own() -> None:
    from typing import get_args

    for name, table in SHAPES.items():
        assert get_args(table.model_fields["shape"].annotation) == (name,)
