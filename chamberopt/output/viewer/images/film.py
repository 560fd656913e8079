"""Pictures that move: frames of constant length, as .gif or .mp4."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.output.viewer.subprocess_drawing import file_path

COLOURS = 96  # of a GIF, the same in all frames: a palette of each frame's own would flicker
SAMPLED = 12  # frames that they are chosen from
FASTEST = 50  # frames a second: a GIF counts in hundredths, and browsers slow down what is faster
MOST_PIXELS = 300_000_000  # of all frames: 0.9 GB
BLOCK = 16  # pixels: what MP4 players can be relied on to show is a multiple of it


def film_path(film: str | Path) -> Path:
    """Where a film may be written. InputError for what is no .gif or .mp4, in no folder, or cannot be written here."""
    path = file_path(film, (".gif", ".mp4"), "films are written as .gif or .mp4")
    if path.suffix.lower() == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise InputError(
            f"{path}: .mp4 needs a further package: pip install 'chamberopt[mp4]', or write a .gif"
        )
    return path


def require_playable(fps: int, size: tuple[int, int], frames: int, path: Path) -> None:
    """InputError for what no player shows as it is meant, or is too much to hold."""
    if not 1 <= fps <= FASTEST:
        raise InputError(f"--fps: given {fps}; 1 to {FASTEST} are supported")
    if min(size) < 64 or max(size) > 4096:
        raise InputError(f"--size: given {size[0]} {size[1]}; 64 to 4096 pixels are supported")
    if path.suffix.lower() == ".mp4" and any(side % BLOCK for side in size):
        raise InputError(f"--size: given {size[0]} {size[1]}; for .mp4 give multiples of {BLOCK}")
    most = MOST_PIXELS // (size[0] * size[1])
    if frames > most:
        raise InputError(
            f"--frames: given {frames}; at most {most} are supported at {size[0]} x {size[1]} pixels"
        )


def write_film(path: Path, frames: Sequence[np.ndarray], fps: int) -> None:
    """Frames (rows, columns, 3) uint8 each; a GIF plays for ever."""
    with atomic_write(path) as temporary:
        if path.suffix.lower() == ".gif":
            _write_gif(temporary, frames, fps)
        else:
            import imageio.v2 as imageio

            imageio.mimwrite(
                temporary, list(frames), fps=fps, codec="libx264", quality=7, macro_block_size=BLOCK
            )


def _write_gif(path: Path, frames: Sequence[np.ndarray], fps: int) -> None:
    from PIL import Image

    some = [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, SAMPLED).astype(int))]
    palette = Image.fromarray(_fair_share(some)).quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=round(1000 / fps),
        loop=0,
        optimize=True,
        disposal=1,
    )


def _fair_share(frames: Sequence[np.ndarray]) -> np.ndarray:
    """Colours (1, n, 3) uint8 of these frames, each as often as the square root of its pixels: what is small and bright
    counts beside a large background.
    """
    pixels = np.concatenate([frame.reshape(-1, 3) for frame in frames])
    codes = (pixels >> 2).astype(np.uint32) @ np.array([1, 64, 4096], dtype=np.uint32)
    _, first, count = np.unique(codes, return_index=True, return_counts=True)
    return np.repeat(pixels[first], np.ceil(np.sqrt(count)).astype(int), axis=0)[None]
