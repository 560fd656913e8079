"""Some milliseconds of shot flight as a film: balls and dents of true size, the sonotrode and the part where they are.

Nothing is drawn between the simulator's own positions, and nothing is enlarged: at its true amplitude the sonotrode
hardly moves in the picture.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.output.viewer.actors import BACKGROUND, DARK, as_it_stands, room
from chamberopt.output.viewer.images.film import write_film
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess
from chamberopt.output.vtp_files import CHAMBER, COVERAGE, MM, pyvista, read_surface

if TYPE_CHECKING:
    from chamberopt.output.resimulate.flight import Flight

# Okabe and Ito's blue and a magenta beside greys: told apart by colour-blind readers, and from the orange sonotrode.
BALL, HIT, DENT, TRAIL = "#5d6b7a", "#FF2E9A", "#0072B2", "#7f8c99"
TARGET, REST = (230, 233, 236), (185, 190, 196)
FLASH = (255, 105, 180)
FRESH = 3  # frames for which a ball that has hit the part, its dent and the triangle are coloured
ZOOM = 1.4
EYE = (1.0, -1.6, 0.12)
TAIL = 3  # frames that trails reach back
LIFT = 2e-5  # m, off the part: dents lie on it, not in it
SLOWEST = 10.0  # s a frame, without a graphics card
FEW = 2000  # balls that are drawn round; of more, with fewer sides


def draw_replay(
    result: Path,
    seen: Flight,
    film: Path,
    fps: int,
    size: tuple[int, int],
    view: tuple[float, float, float] = EYE,
) -> str | None:
    """Draw a flight into a .gif or .mp4, fps frames a second. None, or one line saying why there is no film.

    result: folder whose chamber and part are drawn · view: where the eye is, as seen from the chamber's middle.
    film, fps and size: as film.film_path and require_playable let them pass.
    """
    slower = (len(seen.time) - 1) / (fps * (seen.time[-1] - seen.time[0]))
    face = (
        f"± {1e6 * seen.amplitude:g} µm, to scale"
        if seen.sonotrodes
        else "drawn still: no ball meets it at one phase"
    )
    title = f"{result.resolve().name}   slowed {slower:.3g} times   sonotrode {face}   magenta: has just hit the part"
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "flight.npz"
        point, axis = (np.zeros(3), np.zeros(3)) if seen.part_axis is None else seen.part_axis
        np.savez(
            data, time=seen.time, balls=seen.balls, trail=seen.trail, diameter=seen.diameter, angle=seen.part_angle,
            point=point, axis=axis, tags=np.array(list(seen.sonotrodes), dtype=int),
            swings=np.array(list(seen.sonotrodes.values())), dent_place=seen.dents.place,
            dent_normal=seen.dents.normal, dent_radius=seen.dents.radius, dent_time=seen.dents.time,
            hit_time=seen.impacts.time, hit_ball=seen.impacts.ball, hit_triangle=seen.part_triangle,
        )  # fmt: skip
        job = {"draw": "replay", "folder": str(result), "flight": str(data), "title": title,
               "fps": fps, "size": list(size), "view": list(view)}  # fmt: skip
        return draw_in_subprocess(job, film, 600.0 + SLOWEST * len(seen.time))


def render_replay(job: dict[str, Any]) -> None:
    """All frames, one after another, in one plotter."""
    with np.load(job["flight"]) as data:
        flight = dict(data)
    plotter = pyvista().Plotter(off_screen=True, window_size=job["size"])
    stage = _Stage(plotter, Path(job["folder"]), flight, job)
    frames = []
    for number in range(len(flight["time"])):
        stage.show(number)
        frames.append(np.ascontiguousarray(plotter.screenshot(return_img=True)[..., :3]))
    write_film(Path(job["picture"]), frames, job["fps"])


class _Stage:
    """The chamber with everything in it, as it is in one frame after another."""

    def __init__(
        self, plotter: Any, folder: Path, flight: dict[str, np.ndarray], job: dict[str, Any]
    ) -> None:
        self.plotter, self.flight = plotter, flight
        self.step = float(flight["time"][1] - flight["time"][0])
        chamber, part = read_surface(folder / CHAMBER), read_surface(folder / COVERAGE)
        plotter.set_background(BACKGROUND)
        plotter.remove_all_lights()
        plotter.add_light(pyvista().Light(light_type="headlight"))
        self.sonotrodes, _ = room(plotter, chamber)
        self.plain = np.where((np.asarray(part["target"]) > 0)[:, None], TARGET, REST).astype(
            np.uint8
        )
        part["colour"] = self.plain.copy()
        self.surface, self.part = (
            part,
            plotter.add_mesh(part, scalars="colour", rgb=True, ambient=0.4, diffuse=0.6),
        )
        sides = 20 if len(flight["diameter"]) < FEW else 8
        self.ball = pyvista().Sphere(radius=0.5, theta_resolution=sides, phi_resolution=sides)
        self.disc = pyvista().Disc(inner=0.0, outer=1.0, normal=(1.0, 0.0, 0.0), r_res=1, c_res=16)
        self.title = job["title"]
        plotter.camera_position = [job["view"], (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
        plotter.reset_camera(bounds=chamber.bounds)
        plotter.camera.zoom(ZOOM)
        plotter.camera.SetWindowCenter(0.0, -0.08)  # makes room for the text
        plotter.enable_anti_aliasing("ssaa")

    def show(self, number: int) -> None:
        """Everything at the time of this frame."""
        flight, now = self.flight, self.flight["time"][number]
        for tag, swing in zip(flight["tags"], flight["swings"], strict=True):
            self.sonotrodes[int(tag)].position = swing[number] * MM
        pose = turn_matrix(flight["point"] * MM, flight["axis"], float(flight["angle"][number]))
        self.part.user_matrix = pose
        recent = (flight["hit_time"] <= now) & (flight["hit_time"] > now - FRESH * self.step)
        hit = np.isin(np.arange(len(flight["diameter"])), flight["hit_ball"][recent])
        colours = self.plain.copy()
        colours[flight["hit_triangle"][recent]] = FLASH
        self.surface["colour"] = colours
        self._balls("balls", number, ~hit, BALL)
        self._balls("hitting", number, hit, HIT)
        there = flight["dent_time"] <= now
        fresh = there & (flight["dent_time"] > now - FRESH * self.step)
        self._dents("dents", there & ~fresh, DENT, pose)
        self._dents("new dents", fresh, HIT, pose)
        trail = flight["trail"][max(0, number - TAIL + 1) : number + 1].reshape(-1, 3)
        trail = trail[np.isfinite(trail[:, 0])]
        self._replace(
            "trails",
            pyvista().PolyData(trail * MM) if len(trail) else None,
            color=TRAIL,
            point_size=2.0,
        )
        impacts = int((flight["hit_time"] <= now).sum())
        clock = f"{1e3 * now:.3f} ms after the warm-up   {impacts} impacts on the part, {int(there.sum())} dents"
        text = as_it_stands(f"{clock} since {1e3 * flight['time'][0]:g} ms\n{self.title}")
        self.plotter.add_text(
            text, position="lower_left", font_size=8, color=DARK, name="clock", render=False
        )
        self.plotter.render()

    def _balls(self, name: str, number: int, chosen: np.ndarray, colour: str) -> None:
        mesh = None
        if chosen.any():
            centres = pyvista().PolyData(self.flight["balls"][number][chosen] * MM)
            centres["diameter"] = self.flight["diameter"][chosen] * MM
            mesh = centres.glyph(geom=self.ball, scale="diameter", orient=False)
        self._replace(name, mesh, color=colour, smooth_shading=True, specular=0.4)

    def _dents(self, name: str, chosen: np.ndarray, colour: str, pose: np.ndarray) -> None:
        mesh = None
        if chosen.any():
            normal = -self.flight["dent_normal"][chosen]  # into the room
            places = pyvista().PolyData((self.flight["dent_place"][chosen] + LIFT * normal) * MM)
            places["normal"], places["radius"] = normal, self.flight["dent_radius"][chosen] * MM
            mesh = places.glyph(geom=self.disc, scale="radius", orient="normal")
        self._replace(name, mesh, color=colour, lighting=False)
        if mesh is not None:
            self.plotter.actors[name].user_matrix = pose

    def _replace(self, name: str, mesh: Any, **style: Any) -> None:
        if mesh is None:
            self.plotter.remove_actor(name, render=False)
        else:
            self.plotter.add_mesh(
                mesh, name=name, reset_camera=False, show_scalar_bar=False, render=False, **style
            )


def turn_matrix(point: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """A turn (4, 4) about the line through a point along a unit vector (Rodrigues); no turn about a zero one."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
    matrix[:3, 3] = point - matrix[:3, :3] @ point
    return matrix
