"""What of a target is outside the chamber is told from what no ball can touch."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from chamberopt.pictures.actors import colour_meanings
from chamberopt.pictures.drawn_part import DrawnPart, _round_range, colour_range
from chamberopt.results.vtp_files import Surface, pyvista


def wall(low: float, high: float) -> Surface:
    """A standing square, of two triangles for each millimetre of its height [mm]."""
    rows = int(high - low)
    plane = (
        pyvista()
        .Plane(
            center=(0.0, 0.0, 0.5 * (low + high)), direction=(1.0, 0.0, 0.0), i_size=high - low,
            j_size=10.0, i_resolution=rows, j_resolution=1,
        )
        .triangulate()
    )  # fmt: skip
    return pyvista().PolyData(plane.points, plane.faces)


def test_what_is_outside_the_chamber_is_apart() -> None:
    field = wall(0.0, 10.0)
    height = np.asarray(field.points)[:, 2]
    field.cell_data["target"] = np.ones(field.n_cells, dtype=np.uint8)
    field.cell_data["triangle"] = np.arange(field.n_cells)
    for name, column in (
        ("reachable", (height < 4.5).astype(float)),
        ("resolved", np.ones(field.n_points)),
        ("dent_density", np.ones(field.n_points)),
    ):
        field.point_data[name] = column
    chamber = wall(0.0, 6.0)
    chamber["tag"] = np.zeros(chamber.n_cells, dtype=np.uint8)
    assert DrawnPart(field.copy()).outside.n_cells == 0
    part = DrawnPart(field, chamber=chamber)
    assert part.target.n_cells + part.unreached.n_cells == part.inside.n_cells
    assert part.outside.cell_centers().points[:, 2].min() > 6.0
    assert part.inside.cell_centers().points[:, 2].max() < 6.0
    assert part.unreached.n_cells > 0
    meanings = [meaning for _, meaning in colour_meanings([part])]
    assert meanings == ["out of the shot's reach", "target outside the chamber"]


def shown(value: float) -> DrawnPart:
    """A wall whose coverage is the same everywhere [%]."""
    field = wall(0.0, 10.0)
    field.cell_data["area"] = np.ones(field.n_cells)
    field.point_data["shown"] = np.full(field.n_points, value)
    part: Any = SimpleNamespace(target=field, quantity=SimpleNamespace(unit="%"))
    return part


def test_a_scale_of_colours_has_a_length_where_all_is_the_same() -> None:
    assert colour_range([shown(95.0)]) == (95.0, 100.0)
    assert colour_range([shown(100.0)]) == (95.0, 100.0)
    assert colour_range([shown(0.0)]) == (0.0, 5.0)
    assert colour_range([shown(100.0), shown(20.0)]) == (20.0, 100.0)
    for value in (5.0, 0.37, 1e4):
        low, high = _round_range(value, value)
        assert low <= value < high or low < value <= high
