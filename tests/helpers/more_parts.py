"""A further four parts as a shop gets them: each is written into a folder.

from tests.helpers.more_parts import MORE_PARTS
path = MORE_PARTS["connecting_rod"].write(folder)
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from manifold3d import CrossSection, JoinType, Manifold

from tests.helpers.eight_parts import ExamplePart
from tests.helpers.mesh_files import write_stl

AROUND = 96  # facets of a circle
ROD = 95.0  # of a connecting rod, from bore to bore [mm]


def connecting_rod(folder: Path) -> Path:
    """A connecting rod, 132 x 48 x 20 mm, with a pocket on both sides: OBJ in mm with groups."""
    round_ = lambda radius, x: CrossSection.circle(radius, AROUND).translate([x, 0])  # noqa: E731
    sides = CrossSection([[(0, -11), (ROD, -8), (ROD, 8), (0, 11)]])
    plan = (round_(24.0, 0.0) + round_(13.0, ROD) + sides).offset(
        8.0, JoinType.Round, circular_segments=AROUND
    )
    plan = plan.offset(-8.0, JoinType.Round, circular_segments=AROUND)  # hollow corners of 8 mm
    body = Manifold.extrude(plan, 20.0) - _pin(17.0, 0.0, 30.0) - _pin(8.5, ROD, 30.0)
    turn = np.radians(np.linspace(0.0, 90.0, 7))
    rings = []  # a pocket of 6 mm with a fillet of 3 mm round its floor
    for inside, z in [
        (-0.5, 1.0),
        *zip(3 * (1 - np.cos(turn)), -3 - 3 * np.sin(turn), strict=True),
    ]:
        corners = [(34, -6.5), (74, -4.5), (74, 4.5), (34, 6.5)]
        ring = CrossSection([corners]).offset(-inside - 3.0, JoinType.Round)
        ring = ring.offset(3.0, JoinType.Round, circular_segments=24).to_polygons()[0]
        rings.append(np.c_[ring, np.full(len(ring), z)])
    pocket = Manifold.hull_points(np.concatenate(rings))
    body -= pocket.translate([0, 0, 20]) + pocket.scale([1, 1, -1])
    mesh = body.to_mesh()
    points, triangles = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)
    middle = points[triangles].mean(axis=1)[:, :2]
    big, small = (np.linalg.norm(middle - [x, 0.0], axis=1) for x in (0.0, ROD))
    of_names = [(big < 17.1) | (small < 8.6), big < 24.1, small < 13.1]
    names = np.select(of_names, ["BORES", "BIG_END", "SMALL_END"], "SHANK")
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    for name in np.unique(names):
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in triangles[names == name] + 1)]
    path = folder / "connecting_rod.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def _pin(radius: float, x: float, length: float) -> Manifold:
    """An upright round bar [mm] that begins below z = 0."""
    bar = Manifold.cylinder(length, radius, circular_segments=AROUND)
    return bar.translate([x, 0, -0.2 * length])


def turbine_disc(folder: Path) -> Path:
    """A disc of 100 mm with a bore and eight holes in its web: Nastran in metres, with names."""
    turn = np.radians(np.linspace(0.0, 90.0, 8))
    hub = np.c_[26 - 6 * np.sin(turn), 10 - 6 * np.cos(turn)][::-1]  # fillets of 6 and 4 mm
    rim = np.c_[40 + 4 * np.sin(turn), 8 - 4 * np.cos(turn)]
    upper = np.r_[[(12, 15), (20, 15)], hub, rim, [(44, 9), (50, 9)]]
    profile = np.r_[upper * [1, -1], upper[::-1]]
    body = Manifold.revolve(CrossSection([profile]), circular_segments=AROUND)
    angle = 2.0 * np.pi * np.arange(8) / 8
    holes = 33.0 * np.c_[np.cos(angle), np.sin(angle)]
    for x, y in holes:
        body -= Manifold.cylinder(40.0, 3.5, circular_segments=32).translate([x, y, -20])
    mesh = body.to_mesh()
    points, triangles = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)
    middle = points[triangles].mean(axis=1)
    radius = np.linalg.norm(middle[:, :2], axis=1)
    from_hole = np.linalg.norm(middle[:, None, :2] - holes, axis=2).min(axis=1)
    of_names = [from_hole < 3.55, radius < 12.5, radius < 22.0, radius < 43.0]
    kind = np.select(of_names, [1, 2, 3, 4], 5)
    names = ["BOLT_HOLES", "BORE", "HUB", "WEB", "RIM"]
    cards = [f'$HMNAME PROP {k} "{name}"' for k, name in enumerate(names, start=1)]
    cards += [f"PSHELL,{k},1,0.001" for k in range(1, 6)] + ["MAT1,1,2.+11,,0.3"]
    cards += [f"GRID,{k},,{x:.8f},{y:.8f},{z:.8f}" for k, (x, y, z) in enumerate(1e-3 * points, 1)]
    cards += [
        f"CTRIA3,{k},{kind[k - 1]},{a},{b},{c}" for k, (a, b, c) in enumerate(triangles + 1, 1)
    ]
    path = folder / "turbine_disc.bdf"
    path.write_text("\n".join(["SOL 101", "CEND", "BEGIN BULK", *cards, "ENDDATA"]) + "\n")
    return path


def leaf_spring(folder: Path) -> Path:
    """A bent leaf of 171 x 36 mm, 5 mm thick, with a hole of 8 mm: STEP in mm, without names."""
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.Verbosity", 0)
        occ, half = gmsh.model.occ, np.radians(20.0)
        section = [(2, occ.addRectangle(250.0, -18.0, 0.0, 5.0, 36.0))]
        occ.rotate(section, 0, 0, 0, 0, 1, 0, half)
        leaf = occ.revolve(section, 0, 0, 0, 0, 1, 0, -2.0 * half)
        hole = occ.addCylinder(240.0, 0.0, 0.0, 30.0, 0.0, 0.0, 4.0)
        occ.cut([one for one in leaf if one[0] == 3], [(3, hole)])
        occ.synchronize()
        path = folder / "leaf_spring.step"
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def pelton_bucket(folder: Path) -> Path:
    """A scanned bucket of a Pelton wheel, two bowls on a foot: binary STL in mm with noise."""
    step = 1.4
    axes = [np.arange(low, high, step) for low, high in ((-42, 43), (-36, 68), (-27, 6))]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    grid = pv.ImageData(
        dimensions=tuple(map(len, axes)), spacing=(step,) * 3, origin=(-42, -36, -27)
    )
    grid["distance"] = _from_bucket(places.reshape(-1, 3)).reshape(places.shape[:3]).ravel("F")
    surface = grid.contour([0.0], scalars="distance")
    mesh = trimesh.Trimesh(surface.points, surface.regular_faces[:, ::-1], process=True)
    trimesh.smoothing.filter_taubin(mesh, iterations=10)
    noise = np.random.default_rng(3).normal(0.0, 0.015, (len(mesh.vertices), 1))
    points = np.asarray(mesh.vertices + mesh.vertex_normals * noise)
    return write_stl(folder / "pelton_bucket.stl", points[mesh.faces])


def _from_bucket(places: np.ndarray) -> np.ndarray:
    """Distance (n,) [mm] from the bucket's surface, about, negative inside."""

    def bowl(half: tuple[float, float, float], x: float) -> np.ndarray:
        """About the distance from an ellipsoid with these half axes."""
        away = np.linalg.norm((places - [x, 0, 0]) / half, axis=1)
        return (away - 1.0) * min(half)

    outside = np.minimum(bowl((22, 32, 24), -18.0), bowl((22, 32, 24), 18.0))
    foot = np.abs(places - [0, 44, -9]) - [11, 20, 7]
    foot = np.linalg.norm(np.maximum(foot, 0), axis=1) + np.minimum(foot.max(axis=1), 0) - 2.0
    blended = -2.5 * np.log(np.exp(-outside / 2.5) + np.exp(-foot / 2.5))
    inside = np.minimum(bowl((16.5, 26, 18), -18.0), bowl((16.5, 26, 18), 18.0))
    return np.maximum(np.maximum(blended, -inside), places[:, 2])


MORE_PARTS = {
    "connecting_rod": ExamplePart(connecting_rod, (132.0, 48.0, 20.0), unit="mm"),
    "turbine_disc": ExamplePart(turbine_disc, (100.0, 100.0, 30.0)),
    "leaf_spring": ExamplePart(leaf_spring, (174.4, 36.0, 20.1)),
    "pelton_bucket": ExamplePart(pelton_bucket, (79.89, 98.1, 24.13), unit="mm"),
}
