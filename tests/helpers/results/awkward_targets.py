"""Parts that hide most of their target, and what is seen of it: drawn in a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import trimesh
from trimesh.boolean import union

from chamberopt.pictures.subprocess_drawing import without_display

TARGETS = {  # of designs with these parts
    "crank pin": "box_mm = [[-7.9, -5.5, -5.5], [7.9, 5.5, 5.5]]",
    "web": "box_mm = [[-2.1, -10.1, -0.1], [2.1, 10.1, 20.1]]",
    "underside": "direction = [0, 0, -1]\nangle_deg = [0, 10]",
    "top": "direction = [0, 0, 1]\nangle_deg = [0, 10]",
}


def box(low: tuple[float, ...], high: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=(low, high))


def rod(radius: float, start: tuple[float, ...], end: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.creation.cylinder(radius, segment=(start, end), sections=24)


def parts() -> dict[str, tuple[trimesh.Trimesh, np.ndarray]]:
    """Name, part [mm] and which of its triangles are the target."""
    webs = [rod(14.0, (x, 0.0, 4.0), (x + 6.0, 0.0, 4.0)) for x in (-14.0, 8.0)]
    crank = union([rod(5.0, (-9.0, 0.0, 0.0), (9.0, 0.0, 0.0)), *webs], engine="manifold")
    tee = [box((-20, -10, 20), (20, 10, 24)), box((-2, -10, 0), (2, 10, 20.5))]
    tee = union(tee, engine="manifold")
    plate = box((-30, -30, 0), (30, 30, 5))
    return {
        "crank pin": (crank, (np.abs(crank.triangles[..., 0]) < 8.1).all(axis=1) & on_rod(crank)),
        "web": (tee, (tee.triangles_center[:, 2] < 20.0) & (np.abs(tee.face_normals[:, 0]) > 0.9)),
        "underside": (plate, plate.face_normals[:, 2] < -0.9),
        "top": (plate, plate.face_normals[:, 2] > 0.9),
    }


def on_rod(crank: trimesh.Trimesh) -> np.ndarray:
    return (np.linalg.norm(crank.triangles[..., 1:], axis=2) < 5.1).all(axis=1) & (
        np.abs(crank.face_normals[:, 0]) < 0.1
    )


def seen_shares() -> dict[str, dict[str, object]]:
    """For each part: the directions of its views, and shares of what can be seen of its target."""
    run = subprocess.run(
        [sys.executable, "-m", __name__], check=True, env=without_display(), capture_output=True,
        cwd=Path(__file__).parents[3], text=True,
    )  # fmt: skip
    return dict(json.loads(run.stdout.splitlines()[-1]))


if __name__ == "__main__":
    from chamberopt.pictures.camera import cells_of, directions, near_views, seen_area
    from chamberopt.results.vtp_files import pyvista

    shares = {}
    for name, (mesh, marked) in parts().items():
        surface = pyvista().PolyData.from_regular_faces(mesh.vertices, mesh.faces)
        eyes = directions()
        seen = seen_area(cells_of(surface, marked), [cells_of(surface, ~marked)], eyes)
        views = near_views(seen, eyes)
        rows = [seen[int(np.argmin(np.linalg.norm(eyes - one, axis=1)))] for one in views]
        shares[name] = {
            "eyes": [one.tolist() for one in views],
            "first": float(rows[0].sum() / seen.sum(axis=1).max()),
            "both": float(np.max(rows, axis=0).sum() / seen.max(axis=0).sum()),
        }
    print(json.dumps(shares))
