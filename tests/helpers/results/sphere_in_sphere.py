"""A result that is a ball in a ball, without a simulation; its fields are known in closed form."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.part import Part, PartOfFile
from chamberopt.coverage.field.display_mesh import DisplayField, DisplayMesh
from chamberopt.coverage.part_impacts import Hits, save_hits, sort_hits_by_triangle
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import ElementNumbers
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.results.arrays_file import ResultArrays, save_result_arrays
from chamberopt.results.vtp_files import pyvista
from chamberopt.results.write import data_digests
from chamberopt.viewer.opened_result import ResultInfo
from chamberopt.viewer.view_state import ViewState

TREATMENT = 10.0  # s
SIZE = 960, 680  # pixels


def ball_result(folder: Path, moved: float = 0.0, lost: int = 0) -> ResultInfo:
    """A results folder whose coverage rises from pole to pole and whose target is all but a cap.

    Triangle k has k % 5 simulated impacts with speeds from 1 to 4 m/s. No ball reaches the lowest
    tenth of the ball, and few dents were simulated on the uppermost. The part is shifted by
    ``moved`` [mm]. If ``lost`` is not 0, every triangle whose number is a multiple of it is
    missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    ball, room = (
        trimesh.creation.icosphere(subdivisions=3, radius=radius) for radius in (0.01, 0.02)
    )
    kept = np.arange(len(ball.faces)) % lost != 0 if lost else np.ones(len(ball.faces), dtype=bool)
    faces, middle = np.asarray(ball.faces, np.int32)[kept], ball.triangles_center[kept]
    count = len(faces)
    vertices = ball.vertices + np.array([moved * 1e-3, 0.0, 0.0])
    target = middle[:, 0] < 0.008
    chamber = _chamber(room, vertices, faces, target)
    impacts = np.arange(count) % 5
    hits = Hits(
        np.repeat(np.arange(count), impacts),
        np.zeros((impacts.sum(), 3), np.float32),
        *(np.zeros(impacts.sum(), np.float32) for _ in range(4)),
    )
    hits = replace(
        hits, speed=np.concatenate([np.arange(1, n + 1) for n in impacts]).astype(np.float32)
    )
    values = {
        **_fields(middle[:, 2]),
        "impacts": impacts,
        "dents": np.full(count, 20),
        "exposed_area_mm2": 1e6 * chamber.exposed_area,
        "target": target.astype(np.uint8),
        "element": chamber.part.elements,
        "mean_normal_speed": np.where(impacts > 0, (1.0 + impacts) / 2.0, np.nan),
    }
    fields = _fields(ball.vertices[:, 2])
    mesh = DisplayMesh(
        vertices, faces, ball.vertices / 0.01, np.zeros(len(vertices), int), np.arange(count)
    )
    save_result_arrays(folder, ResultArrays(chamber, values, DisplayField(mesh, fields)))
    save_hits(folder / "hits.npz", sort_hits_by_triangle([hits], count))
    return ResultInfo(
        folder=str(folder),
        title=f"{folder.name}\nnot simulated",
        treatment_s=TREATMENT,
        longest_s=50.0,
        sha256=data_digests(folder),
    )


def _chamber(
    room: trimesh.Trimesh, vertices: np.ndarray, faces: np.ndarray, target: np.ndarray
) -> Chamber:
    """The room round the ball with the lowest part of its wall as the sonotrode."""
    count, area = len(faces), np.full(len(faces), 1e-6)
    numbers = ElementNumbers(np.arange(count) + 1000, np.zeros(count, np.int8))
    mesh = PartMesh(vertices, faces, numbers, (), "")
    file = PartOfFile(mesh, None, np.eye(3), np.zeros(3))
    wall = np.where(room.triangles_center[:, 2] < -0.015, 1, 2).astype(np.uint8)
    return Chamber(
        vertices=np.concatenate([room.vertices, vertices]),
        triangles=np.concatenate([room.faces, faces[:, ::-1] + len(room.vertices)]).astype("i4"),
        tags=np.concatenate([wall, np.zeros(count, np.uint8)]),
        source=np.concatenate([np.full(len(wall), -1), np.arange(count)]),
        volume=room.volume,
        part=Part(vertices, faces, area, target, "ball", unit="m", file=file),
        exposed_area=area,
        notes=(),
    )


def _fields(z: np.ndarray) -> dict[str, np.ndarray]:
    """Fields by height [m]: coverage from 5 to 95 %."""
    height = 0.5 + 45.0 * z
    return {
        "coverage": height,
        "dent_density": -np.log1p(-height),
        "coverage_interval": np.full(len(z), 0.1),
        "reachable": (z > -0.008).astype(float),
        "resolved": (z < 0.008).astype(float),
        "impacts_per_mm2": 200.0 * height,
        "mean_normal_speed": 1.0 + height,
        "p90_normal_speed": 2.0 + height,
    }


def picture(subject: ResultInfo, look: ViewState) -> np.ndarray:
    """What the window would show of it, (height, width, 3) uint8."""
    from chamberopt.viewer.plotter import ResultPlotter
    from chamberopt.viewer.window import open_results

    stage = ResultPlotter(open_results([subject], look), off_screen=True, size=SIZE)
    stage.draw(look)
    stage.aim(look)
    image = np.asarray(stage.plotter.screenshot(None))[..., :3]
    stage.plotter.close()
    return image


LOOKS = {
    "coverage": ViewState(),
    "pick": ViewState(
        "speed", below=60.0, cut=((0.0, -1.0, 0.0), None), triangle=404, eye=(-1.0, -1.0, 0.5)
    ),
}


def right_and_wrong(folder: Path) -> dict[str, np.ndarray]:
    """The right pictures, and wrong ones in other colours, on another scale or of another mesh."""
    from chamberopt.viewer import plotter

    right = ball_result(folder / "ball")
    drawn = {name: picture(right, look) for name, look in LOOKS.items()}
    coverage, scale = QUANTITIES["coverage"], plotter.colour_limits
    QUANTITIES["coverage"] = replace(coverage, colours="cividis")
    drawn["other colours"] = picture(right, LOOKS["coverage"])
    QUANTITIES["coverage"] = coverage
    plotter.colour_limits = lambda seen, look: (scale(seen, look)[0], 1.25 * scale(seen, look)[1])
    drawn["other limits"] = picture(right, LOOKS["coverage"])
    plotter.colour_limits = scale
    drawn["moved"] = picture(ball_result(folder / "moved" / "ball", moved=1.0), LOOKS["coverage"])
    drawn["lost"] = picture(ball_result(folder / "lost" / "ball", lost=10), LOOKS["coverage"])
    return drawn


def driven(folder: Path) -> list[dict[str, Any]]:
    """What a window shows after each key, click and slide: its look, and what is in its views."""
    from chamberopt.pictures.actors import PALE
    from chamberopt.viewer.window import Window, open_results

    subjects = [ball_result(folder / "one"), ball_result(folder / "two")]
    window = Window(open_results(subjects, ViewState()), ViewState(), off_screen=True)
    steps: list[dict[str, Any]] = []

    def step(name: str) -> None:
        stage = window.view
        stage.plotter.screenshot(None)
        views = []
        for renderer in stage.plotter.renderers:
            actors = renderer.actors
            coloured = [a.mapper.dataset for a in actors.values() if "shown" in _columns(a)]
            views.append({
                "shown": np.concatenate([np.asarray(one["shown"]) for one in coloured]).tolist(),
                "pale": sum(
                    a.mapper.dataset.n_cells
                    for a in actors.values()
                    if _columns(a) and a.prop.color == pyvista().Color(PALE)
                ),
                "words": [a.GetInput() for a in actors.values() if a.IsA("vtkTextActor")],
                "planes": [
                    _planes(a)
                    for a in actors.values()
                    if a.IsA("vtkActor") and a.mapper is not None
                ],
                "charts": len(renderer.get_charts()), "eye": list(renderer.camera.position),
            })  # fmt: skip
        steps.append({
            "step": name, "look": asdict(window.state), "views": views,
            "slider": bool(window.slider is not None and window.slider.GetEnabled()),
            "plane": window.plane is not None,
        })  # fmt: skip

    step("opened")
    for key in "3b1cxg":
        window.press_key(key)
        step(key)
    window.move_plane((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    step("cut")
    window.select_triangle(1, 404)
    step("clicked")
    window.press_key("h")
    step("h")
    window.set_time(25.0)
    step("slid")
    window.press_key("6")  # no result has it
    step("6")
    window.press_key("r")
    step("r")
    width = window.view.plotter.window_size[0]
    window.view.plotter.subplot(0, 1)
    steps[-1]["picked"] = window.view.pick_triangle(int(0.75 * width), 450)
    steps[-1]["beside"] = window.view.pick_triangle(int(0.55 * width), 450)
    return steps


def _columns(actor: Any) -> list[str]:
    data = getattr(getattr(actor, "mapper", None), "dataset", None)
    return [] if data is None else list(data.point_data)


def _planes(actor: Any) -> int:
    planes = actor.mapper.GetClippingPlanes()
    return 0 if planes is None else int(planes.GetNumberOfItems())


if __name__ == "__main__":
    here = Path(sys.argv[2])
    if sys.argv[1] == "pictures":
        np.savez(here / "pictures.npz", **right_and_wrong(here))
    else:
        (here / "steps.json").write_text(json.dumps(driven(here)), encoding="utf-8")
