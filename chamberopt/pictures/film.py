"""Write frames as a film, .gif or .mp4, and draw the frames of a shot flight."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import new_file, write_bytes
from chamberopt.pictures.actors import DARK, Discs, add_chamber, disc_actor, escape_dollars, light
from chamberopt.pictures.camera import Room, Vector, cells_of, fit_camera, target_in_chamber
from chamberopt.pictures.overlay import LINE_HEIGHT, wrap
from chamberopt.pictures.panels import choose_views
from chamberopt.pictures.subprocess_drawing import draw_in_subprocess, file_path
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from chamberopt.results.vtp_files import MM, pyvista

if TYPE_CHECKING:
    from chamberopt.results.flight import FlightFrames

COLOURS = 96  # of a GIF; all frames share them, because changing palettes would flicker
SAMPLED_FRAMES = 12  # frames that the palette is chosen from
MAX_FPS = 50  # a GIF counts in hundredths of a second, and browsers slow down faster films
MIN_SIDE, MAX_SIDE = 64, 4096  # pixels
MAX_PIXELS = 300_000_000  # in all frames together, 0.9 GB
BLOCK = 16  # pixels: every MP4 player shows sides that are multiples of 16


def film_path(film: str | Path) -> Path:
    """Return the path of a film to write.

    Raises InputError if its ending is not supported, or if it cannot be written there.
    """
    path = file_path(film, (".gif", ".mp4"), "films are written as .gif or .mp4")
    missing = [name for name in ("imageio", "imageio_ffmpeg") if find_spec(name) is None]
    if path.suffix.lower() == ".mp4" and missing:
        raise InputError(
            f"{path}: .mp4 needs {' and '.join(missing)}: pip install 'chamberopt[mp4]', "
            "or write a .gif"
        )
    return path


def require_playable(fps: int, size: tuple[int, int], frames: int, path: Path) -> None:
    """Raise InputError for a film that players cannot show properly or memory cannot hold.

    Args:
        fps: frames a second.
        size: width and height [pixels].
        frames: number of frames.
        path: file of the film.
    """
    if not 1 <= fps <= MAX_FPS:
        raise InputError(f"--fps: given {fps}; 1 to {MAX_FPS} are supported")
    given = f"--size: given {size[0]} {size[1]}"
    if min(size) < MIN_SIDE or max(size) > MAX_SIDE:
        raise InputError(f"{given}; {MIN_SIDE} to {MAX_SIDE} pixels are supported")
    if path.suffix.lower() == ".mp4" and any(side % BLOCK for side in size):
        raise InputError(f"{given}; for .mp4 give multiples of {BLOCK}")
    most = MAX_PIXELS // (size[0] * size[1])
    if frames > most:
        raise InputError(
            f"--frames: given {frames}; at most {most} are supported at {size[0]} x {size[1]} "
            "pixels"
        )


def write_film(path: Path, frames: Sequence[np.ndarray], fps: int) -> None:
    """Write frames as a film of `fps` frames a second. A .gif repeats.

    Each frame has the shape (rows, columns, 3), uint8.
    """
    if path.suffix.lower() == ".gif":
        write_bytes(path, _gif(frames, fps))
        return
    import imageio.v2 as imageio
    from imageio_ffmpeg import count_frames_and_secs

    with new_file(path) as file:
        imageio.mimwrite(
            file.name, list(frames), fps=fps, codec="libx264", quality=7, macro_block_size=BLOCK
        )
        try:
            whole = count_frames_and_secs(file.name)[0] == len(frames)
        except RuntimeError:
            whole = False
        if not whole:  # ffmpeg reports no error
            raise OSError("the film could not be written as a whole; is the disk full?")


def _gif(frames: Sequence[np.ndarray], fps: int) -> bytes:
    from PIL import Image

    sampled = np.unique(np.linspace(0, len(frames) - 1, SAMPLED_FRAMES).astype(int))
    pixels = _balanced_pixels([frames[k] for k in sampled])
    palette = Image.fromarray(pixels).quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    content = io.BytesIO()
    images[0].save(
        content, "GIF", save_all=True, append_images=images[1:], duration=round(1000 / fps), loop=0,
        optimize=True, disposal=1,
    )  # fmt: skip
    return content.getvalue()


def _balanced_pixels(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Return pixels from which to choose the few colours of a .gif, (1, n, 3) uint8.

    Each colour of the frames occurs as often as the square root of the number of its pixels. So
    small bright things get colours of their own beside a large background.
    """
    pixels = np.concatenate([frame.reshape(-1, 3) for frame in frames])
    codes = (pixels >> 2).astype(np.uint32) @ np.array([1, 64, 4096], dtype=np.uint32)
    _, first, count = np.unique(codes, return_index=True, return_counts=True)
    return np.repeat(pixels[first], np.ceil(np.sqrt(count)).astype(int), axis=0)[None]


# Blue of Okabe and Ito and a magenta, beside greys. Colour-blind readers tell the colours from one
# another and from the orange sonotrode.
BALL, HIT, DENT, TRAIL = "#5d6b7a", "#FF2E9A", "#0072B2", "#7f8c99"
TARGET, REST = "#e6e9ec", "#a9b0b7"
HIT_FRAMES = 3  # frames in which a ball and its dent are coloured after the hit
TRAIL_FRAMES = 3
FONT = 10
MAX_FRAME_SECONDS = 10.0  # to draw a frame, without a graphics card
MAX_ROUND_BALLS = 2000  # with more balls each has fewer sides


def draw_replay(
    result: Path,
    flight: FlightFrames,
    film: Path,
    fps: int,
    size: tuple[int, int],
    view: Vector | None = None,
    count: Callable[[int], None] = lambda drawn: None,
) -> str | None:
    """Draw some milliseconds of shot flight into a film, with balls and dents at their true size.

    Each frame shows the simulator's own positions. At its true amplitude the sonotrode hardly
    moves.

    Args:
        result: results folder with the chamber and part.
        flight: frames to show.
        film: file to write, .gif or .mp4.
        fps: frames a second.
        size: width and height [pixels].
        view: direction from the chamber's middle to the eye; None for a direction that shows the
            target.
        count: called after each frame with the number of drawn frames.
    Returns:
        None, or one line that says why there is no film.
    """
    slower = (len(flight.time) - 1) / (fps * (flight.time[-1] - flight.time[0]))
    bent = " where it moves most, drawn rigid" if flight.bends else ""
    motion = (
        f"± {1e6 * flight.amplitude:g} µm{bent}, to scale"
        if flight.sonotrodes
        else "drawn still: each ball meets it at a phase of its own"
    )
    title = (
        f"{result.resolve().name}   slowed {slower:.3g} times   sonotrode {motion}   "
        "magenta: has just hit the part   pale: target"
    )
    point, axis = (np.zeros(3), np.zeros(3)) if flight.part_axis is None else flight.part_axis
    poses = [rotation_about_line(point * MM, axis, float(angle)) for angle in flight.part_angle]
    arrays = {
        "time": flight.time,
        "balls": flight.balls * MM,
        "trail": flight.trail * MM,
        "diameter": flight.diameter * MM,
        "pose": np.array(poses),
        "tags": np.array(list(flight.sonotrodes), dtype=int),
        "displacements": np.array(list(flight.sonotrodes.values())) * MM,
        "dent_place": flight.dents.place * MM,
        "dent_normal": -flight.dents.normal,
        "dent_radius": flight.dents.radius * MM,
        "dent_time": flight.dents.time,
        "hit_time": flight.impacts.time,
        "hit_ball": flight.impacts.ball,
    }
    job = {"folder": str(result), "flight": arrays, "title": title, "fps": fps, "size": size,
           "view": view}  # fmt: skip
    longest = 600.0 + MAX_FRAME_SECONDS * len(flight.time)
    return draw_in_subprocess(render_replay, job, film, longest, count)


def render_replay(job: dict[str, Any]) -> Iterator[int | None]:
    """Draw the film of draw_replay; this runs in a child process.

    Yields the number of frames drawn so far after each frame, and None at the end.
    """
    plotter = pyvista().Plotter(off_screen=True, window_size=list(job["size"]))
    scene = _ReplayScene(plotter, Path(job["folder"]), job["flight"], job)
    frames = []
    for number in range(len(job["flight"]["time"])):
        scene.show(number)
        frames.append(np.ascontiguousarray(plotter.screenshot(return_img=True)[..., :3]))
        yield number + 1
    write_film(Path(job["picture"]), frames, job["fps"])
    yield None


def lately_hit(flight: Mapping[str, Any], now: float, recent: float) -> np.ndarray:
    """Return which balls have hit the part within the time `recent` [s] before `now` [s], (n,)."""
    time = flight["hit_time"]
    balls = flight["hit_ball"][(time <= now) & (time > now - recent)]
    return np.isin(np.arange(len(flight["diameter"])), balls)


class _ReplayScene:
    """The chamber with part, balls and dents in a pyvista plotter, shown frame after frame."""

    def __init__(
        self, plotter: Any, folder: Path, flight: dict[str, np.ndarray], job: dict[str, Any]
    ) -> None:
        self.plotter, self.flight, self.title = plotter, flight, job["title"]
        self.width = job["size"][0] - 20
        self.recent = HIT_FRAMES * float(flight["time"][1] - flight["time"][0])
        light(plotter)
        arrays = read_result_arrays(folder / ARRAYS_FILE)
        chamber, surface = arrays.cavity, arrays.part
        self.sonotrodes, _ = add_chamber(plotter, chamber)
        on_target = np.asarray(surface["target"]) > 0
        self.part = [
            plotter.add_mesh(cells_of(surface, chosen), color=colour, ambient=0.55, diffuse=0.45)
            for chosen, colour in ((on_target, TARGET), (~on_target, REST))
            if chosen.any()
        ]
        sides = 20 if len(flight["diameter"]) < MAX_ROUND_BALLS else 8
        self.ball = pyvista().Sphere(radius=0.5, theta_resolution=sides, phi_resolution=sides)
        eye = job["view"] or choose_views([target_in_chamber(surface)], [chamber])[0]
        width, height = job["size"]
        # The longest text of a frame has two lines of clock and title.
        lines = wrap(f"{self._clock(-1, 10**6)}\n{self.title}", width, FONT).count("\n") + 1
        room = Room(10.0, 10.0, min(LINE_HEIGHT * FONT * (lines + 0.5), 0.3 * height), 10.0)
        fit_camera(plotter, np.asarray(chamber.points), np.array(eye), (width, height), room)
        plotter.enable_anti_aliasing("ssaa")

    def show(self, number: int) -> None:
        """Move sonotrodes, part, balls and dents to their places at the time of frame `number`."""
        flight, now = self.flight, self.flight["time"][number]
        for tag, displacement in zip(flight["tags"], flight["displacements"], strict=True):
            self.sonotrodes[int(tag)].position = displacement[number]
        for actor in self.part:
            actor.user_matrix = flight["pose"][number]
        hit = lately_hit(flight, now, self.recent)
        self._show_balls("balls", number, ~hit, BALL)
        self._show_balls("balls that hit", number, hit, HIT)
        dents = self._show_dents(number)
        trail = flight["trail"][max(0, number - TRAIL_FRAMES + 1) : number + 1].reshape(-1, 3)
        trail = trail[np.isfinite(trail[:, 0])]
        self._replace(
            "trails", pyvista().PolyData(trail) if len(trail) else None, color=TRAIL, point_size=2.0
        )
        text = wrap(f"{self._clock(number, dents)}\n{self.title}", self.width, FONT)
        self.plotter.add_text(
            escape_dollars(text),
            position=(10, 10),
            font_size=FONT,
            color=DARK,
            name="clock",
            render=False,
        )
        self.plotter.render()

    def _clock(self, number: int, dents: int) -> str:
        """Return a line with the time of frame `number`, and the impacts and dents until this time.

        Args:
            dents: number of dents until this time.
        """
        flight, now = self.flight, self.flight["time"][number]
        impacts = int((flight["hit_time"] <= now).sum())
        return (
            f"{1e3 * now:.3f} ms after the warm-up   since {1e3 * flight['time'][0]:g} ms "
            f"{impacts} impacts on the part, {dents} fast enough to leave a dent"
        )

    def _show_balls(self, name: str, number: int, chosen: np.ndarray, colour: str) -> None:
        mesh = None
        if chosen.any():
            centres = pyvista().PolyData(self.flight["balls"][number][chosen])
            centres["diameter"] = self.flight["diameter"][chosen]
            mesh = centres.glyph(geom=self.ball, scale="diameter", orient=False)
        self._replace(name, mesh, color=colour, smooth_shading=True, specular=0.4)

    def _show_dents(self, number: int) -> int:
        """Show the dents made until the time of frame `number`, and return how many they are.

        Recent dents have another colour.
        """
        flight, now = self.flight, self.flight["time"][number]
        made = flight["dent_time"] <= now
        recent = flight["dent_time"][made] > now - self.recent
        old, new = pyvista().Color(DENT).int_rgb, pyvista().Color(HIT).int_rgb
        colour = np.where(recent[:, None], new, old).astype(np.uint8)
        place, normal, radius = (
            flight[f"dent_{name}"][made] for name in ("place", "normal", "radius")
        )
        discs = Discs(place, normal, radius, colour)
        self.plotter.remove_actor("dents", render=False)
        if made.any():
            actor = disc_actor(discs)
            actor.SetUserMatrix(pyvista().vtkmatrix_from_array(flight["pose"][number]))
            self.plotter.add_actor(actor, name="dents", reset_camera=False, render=False)
        return len(recent)

    def _replace(self, name: str, mesh: object, **style: Any) -> None:
        if mesh is None:
            self.plotter.remove_actor(name, render=False)
        else:
            self.plotter.add_mesh(
                mesh, name=name, reset_camera=False, show_scalar_bar=False, render=False, **style
            )


def rotation_about_line(point: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the matrix (4, 4) of a rotation about the line through a point along a unit vector.

    The angle is in rad. The matrix follows from Rodrigues' formula.
    A zero vector gives no rotation.
    """
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across
    matrix[:3, 3] = point - matrix[:3, :3] @ point
    return matrix
