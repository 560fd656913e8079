"""Write frames as a film, .gif or .mp4."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import new_file, write_bytes
from chamberopt.output.viewer.subprocess_drawing import file_path

COLOURS = 96  # of a GIF, the same in all frames: with palettes of their own frames would flicker
SAMPLED_FRAMES = 12  # that the palette is chosen from
MAX_FPS = 50  # a GIF counts in hundredths of a second, and browsers slow down what is faster
MIN_SIDE, MAX_SIDE = 64, 4096  # pixels
MAX_PIXELS = 300_000_000  # of all frames: 0.9 GB
BLOCK = 16  # pixels: every MP4 player shows sides that are multiples of it


def film_path(film: str | Path) -> Path:
    """Return where a film may be written; InputError for other suffixes or unusable places."""
    path = file_path(film, (".gif", ".mp4"), "films are written as .gif or .mp4")
    missing = [name for name in ("imageio", "imageio_ffmpeg") if find_spec(name) is None]
    if path.suffix.lower() == ".mp4" and missing:
        raise InputError(
            f"{path}: .mp4 needs {' and '.join(missing)}: pip install 'chamberopt[mp4]', "
            "or write a .gif"
        )
    return path


def require_playable(fps: int, size: tuple[int, int], frames: int, path: Path) -> None:
    """Raise InputError for a film that players do not show properly or that memory cannot hold."""
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
    """Write frames, each (rows, columns, 3) uint8, at `fps` frames a second; a GIF repeats."""
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
        if not whole:  # ffmpeg does not tell
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
    """Return the colours of frames as one row of pixels, (1, n, 3) uint8.

    Each colour occurs as often as the square root of its pixels, so small bright things get
    colours of their own beside a large background.
    """
    pixels = np.concatenate([frame.reshape(-1, 3) for frame in frames])
    codes = (pixels >> 2).astype(np.uint32) @ np.array([1, 64, 4096], dtype=np.uint32)
    _, first, count = np.unique(codes, return_index=True, return_counts=True)
    return np.repeat(pixels[first], np.ceil(np.sqrt(count)).astype(int), axis=0)[None]
