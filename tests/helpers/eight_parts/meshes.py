"""Parts as finite element programs and mesh tools write them; each function returns a file."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import manifold3d
import numpy as np

from tests.helpers.eight_parts.surfaces import closed_tube, smooth_step, tube
from tests.helpers.mesh_files import nodes_text, write_stl


def hip_stem(folder: Path) -> Path:
    """The femoral stem of a hip, 137 mm long: binary STL in metres, without names."""
    along = np.r_[np.linspace(0.0, 1.0, 20) ** 2 * 6.0, np.linspace(8.0, 142.0, 66)]  # [mm]
    start, radius, bend = 88.0, 46.0, np.radians(42.0)
    angle = np.clip((along - start) / radius, 0.0, bend)
    beyond = np.maximum(along - start - radius * bend, 0.0)
    straight = np.minimum(along, start)
    middle = np.stack(
        [
            radius * (1 - np.cos(angle)) + beyond * np.sin(angle),
            0 * along,
            straight + radius * np.sin(angle) + beyond * np.cos(angle),
        ],
        axis=1,
    )
    across = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    neck = smooth_step((along - 92.0) / 26.0)
    wide = (5.0 + 9.5 * smooth_step(along / 95.0)) * (1 - neck) + 6.4 * neck
    deep = (4.4 + 3.6 * smooth_step(along / 95.0)) * (1 - neck) + 6.4 * neck
    round_end = np.sqrt(np.clip(1 - (1 - along / 6.0) ** 2, 2e-3, 1)) * (along < 6.0) + (along >= 6)
    chamfer = 1 - 0.25 * np.clip(along - 140.0, 0, 2) / 2
    turn = 2 * np.pi * np.arange(44) / 44
    power = 0.75 + 0.25 * neck[:, None]  # a rounded rectangle below, a circle at the neck
    x, y = (np.sign(f) * np.abs(f) ** power for f in (np.cos(turn)[None], np.sin(turn)[None]))
    scale = (round_end * chamfer)[:, None]
    rings = (
        middle[:, None]
        + (wide[:, None] * scale * x)[..., None] * across[:, None]
        + (deep[:, None] * scale * y)[..., None] * np.array([0.0, 1.0, 0.0])
    )
    (points, triangles), _ = closed_tube(rings)
    return write_stl(folder / "hip_stem.stl", 1e-3 * points[triangles])


def t_joint(folder: Path) -> Path:
    """The skin of a welded T-joint, 80 x 60 x 55 mm: Nastran, in inches that it does not state.

    The properties are base, web, weld (the two fillets, radius 7 mm) and ends.
    """
    turn = np.radians(np.linspace(0.0, 90.0, 10))
    fillet = np.c_[12.0 - 7.0 * np.sin(turn), 17.0 - 7.0 * np.cos(turn)]  # from base up to web
    outline = [
        ("BASE", _steps((-40, 0), (40, 0))), ("BASE", _steps((40, 0), (40, 10))),
        ("BASE", _steps((40, 10), (12, 10))), ("WELD", fillet[:-1]),
        ("WEB", _steps((5, 17), (5, 55))), ("WEB", _steps((5, 55), (-5, 55))),
        ("WEB", _steps((-5, 55), (-5, 17))), ("WELD", (fillet[::-1] * [-1, 1])[:-1]),
        ("BASE", _steps((-12, 10), (-40, 10))), ("BASE", _steps((-40, 10), (-40, 0))),
    ]  # fmt: skip
    section = np.concatenate([places for _, places in outline])
    names = ["BASE", "WEB", "WELD", "ENDS"]
    kind = [names.index(name) + 1 for name, places in outline for _ in places]
    n, rows = len(section), np.linspace(0.0, 60.0, 25)
    points = np.stack(
        [np.tile(section[:, 0], 25), np.repeat(rows, n), np.tile(section[:, 1], 25)], axis=1
    )
    cards = [f'$HMNAME PROP {k} "{name}"' for k, name in enumerate(names, start=1)]
    cards += [f"PSHELL,{k},1,0.1" for k in range(1, 5)] + ["MAT1,1,3.+7,,0.3"]
    cards += [f"GRID,{k},,{x:.7f},{y:.7f},{z:.7f}" for k, (x, y, z) in enumerate(points / 25.4, 1)]
    number = 0
    for row in range(24):
        for j in range(n):
            a, b = row * n + j + 1, row * n + (j + 1) % n + 1
            number += 1
            cards.append(f"CQUAD4,{number},{kind[j]},{a},{a + n},{b + n},{b}")
    end = np.asarray(manifold3d.triangulate([section])) + 1
    for a, b, c in [*end.tolist(), *(end[:, ::-1] + 24 * n).tolist()]:
        number += 1
        cards.append(f"CTRIA3,{number},4,{a},{b},{c}")
    path = folder / "t_joint.bdf"
    path.write_text("\n".join(["SOL 101", "CEND", "BEGIN BULK", *cards, "ENDDATA"]) + "\n")
    return path


def crank_pin(folder: Path) -> Path:
    """A hollow crank pin between two oval webs, 93 x 93 x 60 mm: Abaqus, hexahedra, in mm.

    Element sets PIN_LAYER and WEBS; surfaces PIN and FILLETS (radius 3 mm).
    """
    count = 60
    turn = np.radians(np.linspace(0.0, 90.0, 6))
    bow_z, bow_r = 15.0 + 3.0 * np.sin(turn), 25.0 - 3.0 * np.cos(turn)
    z = np.r_[np.linspace(0.0, 15.0, 8)[:-1], bow_z, np.linspace(18.0, 30.0, 6)[1:]]
    outside = np.r_[np.full(7, 22.0), bow_r, np.full(5, 25.0)]
    z, outside = np.r_[-z[:0:-1], z], np.r_[outside[:0:-1], outside]
    shell = 8.0 + (outside - 8.0)[:, None] * np.linspace(0.0, 1.0, 5)  # (layers, 5)
    web = 25.0 + 17.0 * np.linspace(0.0, 1.0, 7)[1:]
    radii = np.hstack([shell, np.tile(web, (len(z), 1))])  # (layers, 11); pins use the first 5
    angle = 2 * np.pi * np.arange(count) / count
    oval = np.where(radii > 25.0, (radii - 25.0), 0.0)[..., None] * 0.25 * (1 + np.cos(angle))
    r = radii[..., None] + oval
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z[:, None, None] + 0 * r], axis=-1)
    numbers = np.arange(r.size).reshape(r.shape)
    cells, is_web, layer = [], [], []
    for k in range(len(z) - 1):
        in_web = abs(z[k] + z[k + 1]) > 36.0
        for i in range(10 if in_web else 4):
            corner = [
                np.roll(numbers[k + up, i + out], -side)
                for up in (0, 1)
                for out, side in ((0, 0), (1, 0), (1, 1), (0, 1))
            ]
            cells.append(np.stack(corner, axis=1))
            is_web.append(np.full(count, in_web))
            layer.append(np.full(count, i == 3 and not in_web))
    elements, webs, outer = map(np.concatenate, (cells, is_web, layer))
    used, elements = np.unique(elements, return_inverse=True)
    points, elements = points.reshape(-1, 3)[used], elements.reshape(-1, 8)
    height = np.abs(points[elements].mean(axis=1)[:, 2])
    fillet = outer & (height > 15.0)
    rows = "".join(
        f"{k}, " + ", ".join(map(str, nodes)) + "\n"
        for k, nodes in enumerate((elements + 1).tolist(), start=1)
    )
    sets = {"PIN_LAYER": outer & ~fillet, "FILLET_LAYER": fillet, "WEBS": webs}
    text = "*HEADING\nCrank pin, unit = mm\n*NODE\n" + nodes_text(points)
    text += "*ELEMENT, TYPE=C3D8, ELSET=CRANK\n" + rows
    for name, mask in sets.items():
        members = (np.flatnonzero(mask) + 1).tolist()
        text += f"*ELSET, ELSET={name}\n"
        text += "".join(
            ", ".join(map(str, members[at : at + 16])) + "\n" for at in range(0, len(members), 16)
        )
    text += "*SURFACE, NAME=PIN, TYPE=ELEMENT\nPIN_LAYER, S4\n"
    text += "*SURFACE, NAME=FILLETS, TYPE=ELEMENT\nFILLET_LAYER, S4\n"
    path = folder / "crank_pin.inp"
    path.write_text(text)
    return path


def fan_blade(folder: Path) -> Path:
    """A twisted fan blade on its root, 100 mm high: Gmsh 4.1 in mm, four physical groups."""
    n, heights = 48, np.r_[np.linspace(0.0, 16.0, 7)[:-1], np.linspace(16.0, 100.0, 57)]
    turn = 2 * np.pi * np.arange(n) / n
    share = np.clip((heights - 22.0) / 78.0, 0.0, 1.0)[:, None]  # 0 at the foot, 1 at the tip
    chord, thick = 40.0 + 6.0 * share, 5.0 - 2.6 * share
    x = chord / 2 * np.cos(turn)
    y = thick / 2 * np.sin(turn) * np.sqrt(0.35 + 0.65 * (1 + np.cos(turn)) / 2)
    y = y + chord * (0.07 - 0.03 * share) * (1 - np.cos(turn) ** 2)
    root_x, root_y = (
        half * np.sign(f(turn)) * np.abs(f(turn)) ** 0.5 for half, f in ((21, np.cos), (9, np.sin))
    )
    blend = smooth_step((heights - 14.0) / 10.0)[:, None]
    x, y = root_x * (1 - blend) + x * blend, root_y * (1 - blend) + y * blend
    twist = np.radians(32.0) * share
    rings = np.stack(
        [
            x * np.cos(twist) - y * np.sin(twist),
            x * np.sin(twist) + y * np.cos(twist),
            heights[:, None] + 0 * x,
        ],
        axis=-1,
    )
    (points, triangles), end = closed_tube(rings)
    names = ["ROOT", "SUCTION_SIDE", "PRESSURE_SIDE", "TIP"]
    row, column = np.divmod(np.arange(len(triangles)) // 2, n)
    kind = np.where(heights[np.minimum(row, 62)] < 22.0, 0, np.where(column < n // 2, 1, 2))
    kind = np.select([end == 1, end == 2], [0, 3], kind)
    text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n4\n"
    text += "".join(f'2 {k} "{name}"\n' for k, name in enumerate(names, 1)) + "$EndPhysicalNames\n"
    box = " ".join(f"{v:.6g}" for v in (*points.min(axis=0), *points.max(axis=0)))
    text += "$Entities\n0 0 4 0\n" + "".join(f"{k} {box} 1 {k} 0\n" for k in range(1, 5))
    count = len(points)
    text += f"$EndEntities\n$Nodes\n1 {count} 1 {count}\n2 1 0 {count}\n"
    text += "".join(f"{k}\n" for k in range(1, count + 1))
    text += "".join(f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points) + "$EndNodes\n"
    text += f"$Elements\n4 {len(triangles)} 1 {len(triangles)}\n"
    number = 0
    for k in range(4):
        chosen = triangles[kind == k] + 1
        text += f"2 {k + 1} 2 {len(chosen)}\n"
        for a, b, c in chosen.tolist():
            number += 1
            text += f"{number} {a} {b} {c}\n"
    path = folder / "fan_blade.msh"
    path.write_text(text + "$EndElements\n")
    return path


def spring_seat_ring(folder: Path) -> Path:
    """A spring's seat, a ring of 60 mm with a round groove: binary STL in mm, kept aside."""
    turn = np.radians(np.linspace(180.0, 360.0, 15))
    groove = np.c_[23.5 + 3.5 * np.cos(turn), 8.0 + 3.5 * np.sin(turn)]
    corners = np.array([(17.0, 8.0), (17.0, 0.0), (30.0, 0.0), (30.0, 8.0)])
    sides = [_steps(a, b) for a, b in pairwise(corners)]
    ends = _steps(corners[3], groove[-1]), _steps(groove[0], corners[0])
    profile = np.concatenate([*sides, ends[0], groove[:0:-1], ends[1]])
    angle = 2 * np.pi * np.arange(96)[:, None] / 96
    r, z = profile[:, 0], profile[:, 1]
    rings = np.stack([r * np.cos(angle), r * np.sin(angle), z + 0 * angle], axis=-1)
    triangles = tube(rings, around=True)
    return write_stl(folder / "spring_seat_ring.stl", rings.reshape(-1, 3)[triangles][:, ::-1])


def _steps(start: tuple[float, ...], end: tuple[float, ...]) -> np.ndarray:
    """Points (k, 2) about 2.5 mm apart from a start to an end, which is left out."""
    a, b = np.array(start, dtype=float), np.array(end, dtype=float)
    count = max(1, round(float(np.linalg.norm(b - a)) / 2.5))
    return a + (b - a) * (np.arange(count) / count)[:, None]
