"""Four more parts as a shop gets them: each is written into a folder.

from tests.helpers.four_parts import FOUR_PARTS
path = FOUR_PARTS["torsion_spring"].write(folder)
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold

from tests.helpers.eight_parts import ExamplePart
from tests.helpers.eight_parts.surfaces import closed_tube, tube
from tests.helpers.mesh_files import write_stl

WIRE, COIL, TURNS, GAP, LEG = 4.0, 40.0, 3.75, 1.988, 35.0  # of the spring [mm]
TEETH, MODULE, CONE, FACE, BORE = 20, 3.0, np.radians(45.0), 12.0, 8.0  # of the gear [mm]


def vane(folder: Path) -> Path:
    """An aerofoil of 45 mm chord, twisted by 12 degrees, on a dovetail: STEP in mm, without names.

    Gmsh writes its translator's name where the name of the product belongs.
    """
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    half = np.linspace(0.0, np.pi, 13)
    chord = 0.5 * (1.0 - np.cos(half))  # from the leading to the trailing edge
    thick = 0.6 * (
        0.2969 * np.sqrt(chord) - 0.126 * chord - 0.3516 * chord**2 + 0.2843 * chord**3
        - 0.1015 * chord**4
    )  # fmt: skip
    camber = 0.32 * chord * (1.0 - chord)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.Verbosity", 0)
        occ = gmsh.model.occ
        outlines = []
        for share in (0.0, 0.5, 1.0):
            length, turn, z = 45.0 - 10.0 * share, np.radians(12.0 * share), 16.0 + 66.0 * share
            sides = []
            for side in (camber + thick, camber - thick):
                x, y = length * (chord - 0.5), length * (side - 0.05)
                x, y = np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y
                sides.append([occ.addPoint(a, b, z) for a, b in zip(x, y, strict=True)])
            front, back = sides
            back[0] = front[0]  # a round leading edge, and a trailing edge 0.1 mm thick
            spline, flat = occ.addBSpline(front), occ.addLine(front[-1], back[-1])
            outlines.append(occ.addWire([spline, flat, occ.addBSpline(back)]))
        blade = occ.addThruSections(outlines)
        profile = [(-7, 0), (7, 0), (9, 2), (5.5, 8), (12, 10), (12, 17)]
        profile += [(-x, z) for x, z in profile[::-1]]
        corners = [occ.addPoint(-26.0, y, z) for y, z in profile]
        sides = [occ.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        root = occ.extrude([(2, occ.addPlaneSurface([occ.addWire(sides)]))], 52.0, 0, 0)
        occ.fuse(blade, [one for one in root if one[0] == 3])
        occ.synchronize()
        path = folder / "vane.step"
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def bracket(folder: Path) -> Path:
    """An angle of 5 x 2 x 3 in with a fillet, a slot and two holes: binary STL in inches."""
    turn = np.radians(np.linspace(0.0, 90.0, 9))
    fillet = np.c_[0.75 - 0.375 * np.sin(turn), 0.75 - 0.375 * np.cos(turn)]
    profile = np.r_[[(0, 0), (5, 0), (5, 0.375)], fillet, [(0.375, 3), (0, 3)]]
    body = Manifold.extrude(CrossSection([profile]), 2.0)
    for x in (2.0, 4.0):
        hole = Manifold.cylinder(1.0, 0.25, circular_segments=48).rotate([90, 0, 0])
        body -= hole.translate([x, 0.7, 1.0])
    body -= Manifold.cube([1.0, 1.5, 0.1]).translate([-0.3, 1.25, 0.95])  # a slot of 2.5 mm
    mesh = body.to_mesh()
    return write_stl(folder / "bracket.stl", mesh.vert_properties[mesh.tri_verts])


def torsion_spring(folder: Path) -> Path:
    """A spring of 3.75 coils of 4 mm wire, 1.988 mm apart: Gmsh in metres, groups by name."""
    rise = (WIRE + GAP) / np.sqrt(1.0 - ((WIRE + GAP) / (np.pi * COIL)) ** 2)  # a turn
    angle = np.linspace(0.0, 2.0 * np.pi * TURNS, int(48 * TURNS) + 1)
    coil = np.c_[COIL / 2 * np.cos(angle), COIL / 2 * np.sin(angle), rise * angle / (2 * np.pi)]
    slope = np.c_[-np.sin(angle), np.cos(angle), 0 * angle + rise / (np.pi * COIL)]
    slope /= np.linalg.norm(slope, axis=1)[:, None]
    steps = np.linspace(0.0, LEG, 8)[1:, None]
    middle = np.r_[coil[0] - steps[::-1] * slope[0], coil, coil[-1] + steps * slope[-1]]
    along = np.r_[np.repeat(slope[:1], 7, axis=0), slope, np.repeat(slope[-1:], 7, axis=0)]
    out = np.c_[np.cos(angle), np.sin(angle), 0 * angle]
    out = np.r_[np.repeat(out[:1], 7, axis=0), out, np.repeat(out[-1:], 7, axis=0)]
    turn = 2.0 * np.pi * np.arange(24) / 24
    rings = middle[:, None] + WIRE / 2 * (
        np.cos(turn)[:, None] * out[:, None] + np.sin(turn)[:, None] * np.cross(along, out)[:, None]
    )
    (points, triangles), side = closed_tube(rings)
    ring = triangles.min(axis=1) // 24
    kind = np.where(side > 0, 3, np.where((ring < 7) | (ring >= len(rings) - 8), 2, 1))
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "3"]
    lines += ['2 1 "COILS"', '2 2 "LEGS"', '2 3 "ENDS"', "$EndPhysicalNames"]
    lines += ["$Nodes", str(len(points))]
    lines += [f"{k} {x:.9g} {y:.9g} {z:.9g}" for k, (x, y, z) in enumerate(1e-3 * points, 1)]
    lines += ["$EndNodes", "$Elements", str(len(triangles))]
    lines += [
        f"{k} 2 2 {kind[k - 1]} {kind[k - 1]} {a} {b} {c}"
        for k, (a, b, c) in enumerate(triangles + 1, 1)
    ]
    path = folder / "torsion_spring.msh"
    path.write_text("\n".join([*lines, "$EndElements"]) + "\n")
    return path


def bevel_gear(folder: Path) -> Path:
    """A straight bevel gear of 20 teeth of module 3 mm, without names: OBJ in mm, not stated.

    The apex of the pitch cone is the origin, and the axis is z.
    """
    pitch = MODULE * TEETH / 2
    back = pitch / np.cos(CONE)  # pitch radius of the spur gear that has the teeth's profile
    base, tip, low = back * np.cos(np.radians(20.0)), MODULE, -1.2 * MODULE
    involute = lambda r: np.tan(np.arccos(base / r)) - np.arccos(base / r)  # noqa: E731
    height = np.linspace(low, tip, 8)
    radius = np.maximum(back + height, base)
    half = (np.pi * MODULE / 4.0 / back + involute(back) - involute(radius)) * back / pitch
    angle = np.r_[-half, half[::-1]]  # a tooth, from one side of its root to the other
    height = np.r_[height, height[::-1]]
    r, z = pitch + height * np.cos(CONE), pitch / np.tan(CONE) - height * np.sin(CONE)
    teeth = np.concatenate([angle + 2 * np.pi * k / TEETH for k in range(TEETH)])
    heel = np.c_[np.tile(r, TEETH) * np.cos(teeth), np.tile(r, TEETH) * np.sin(teeth)]
    heel = np.c_[heel, np.tile(z, TEETH)]
    toe = heel * (1.0 - FACE * np.sin(CONE) / pitch)
    at_root = np.sort(np.r_[np.arange(TEETH) * 16, np.arange(TEETH) * 16 + 15])

    def circle(radius: float, z: float) -> np.ndarray:
        around = teeth[at_root]
        return np.c_[radius * np.cos(around), radius * np.sin(around), 0 * around + z]

    rings = [toe, heel]
    hub = [heel[at_root], circle(r[0], z[0] + 7.0), circle(BORE, z[0] + 7.0)]
    hub += [circle(BORE, toe[0, 2]), toe[at_root]]
    points = np.concatenate([*rings, *hub[1:-1]])
    n, m = len(teeth), len(at_root)
    sides = tube(np.stack(rings))
    across = np.arange(7)
    strip = np.stack([across, across + 1, 14 - across, 15 - across], axis=1)
    strip = (strip + 16 * np.arange(TEETH)[:, None, None]).reshape(-1, 4)
    ends = np.concatenate([strip[:, [0, 1, 2]], strip[:, [0, 2, 3]]])
    numbers = np.concatenate([n + at_root, 2 * n + np.arange(3 * m), at_root])
    body = numbers[tube(np.stack(hub))]
    triangles = np.concatenate([sides, ends + n, ends[:, ::-1], body])
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    path = folder / "bevel_gear.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


FOUR_PARTS = {
    "vane": ExamplePart(vane, (52.0, 24.0, 82.0)),
    "bracket": ExamplePart(bracket, (127.0, 76.2, 50.8), unit="in"),
    "torsion_spring": ExamplePart(torsion_spring, (57.1, 57.1, 29.8), target="COILS"),
    "bevel_gear": ExamplePart(bevel_gear, (64.2, 64.2, 19.6), unit="mm"),
}
