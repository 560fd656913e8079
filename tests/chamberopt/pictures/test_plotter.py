"""Views of a fixed result compared with committed pictures.

Other colours, scales or meshes are noticed.

Compared are means over blocks of 20 by 20 pixels, which hardly depend on how a driver smooths
edges. TOLERANCE is a share of 1: softening every edge over three pixels changes a block by 0.011,
losing one triangle in ten by 0.035 and more. To draw the pictures again, after a change that is
wanted and has been looked at:

    python -m tests.chamberopt.pictures.test_plotter
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import uniform_filter

from chamberopt.pictures.subprocess_drawing import without_display
from tests.helpers.opengl import needs_opengl

REFERENCES = Path(__file__).parents[2] / "pictures"
BLOCK, TOLERANCE = 20, 0.02


def drawn(folder: Path) -> dict[str, np.ndarray]:
    """Draw the pictures of tests/helpers/results/sphere_in_sphere.py in a process of its own."""
    command = [
        sys.executable,
        "-m",
        "tests.helpers.results.sphere_in_sphere",
        "pictures",
        str(folder),
    ]
    subprocess.run(command, check=True, env=without_display(), cwd=REFERENCES.parents[1])
    with np.load(folder / "pictures.npz") as pictures:
        return {name: pictures[name] for name in pictures.files}


def reference(name: str) -> np.ndarray:
    return np.asarray(Image.open(REFERENCES / f"{name}.png").convert("RGB"))


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """The largest between the means of their blocks, of 1."""
    assert one.shape == other.shape
    means = [
        image.reshape(image.shape[0] // BLOCK, BLOCK, image.shape[1] // BLOCK, BLOCK, 3).mean(
            axis=(1, 3)
        )
        / 255.0
        for image in (one, other)
    ]
    return float(np.abs(means[0] - means[1]).max())


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    return drawn(tmp_path_factory.mktemp("pictures"))


@needs_opengl
@pytest.mark.parametrize("name", ["coverage", "pick"])
def test_a_result_looks_as_it_did(pictures: dict[str, np.ndarray], name: str) -> None:
    assert difference(pictures[name], reference(name)) < TOLERANCE


@needs_opengl
@pytest.mark.parametrize("wrong", ["other colours", "other limits", "moved", "lost"])
def test_what_is_wrong_is_noticed(pictures: dict[str, np.ndarray], wrong: str) -> None:
    assert difference(pictures[wrong], reference("coverage")) > TOLERANCE


@needs_opengl
@pytest.mark.parametrize("name", ["coverage", "pick"])
def test_softer_edges_are_no_change(name: str) -> None:
    assert difference(uniform_filter(reference(name), (3, 3, 1)), reference(name)) < TOLERANCE


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as temporary:
        redrawn = drawn(Path(temporary))
    for name in ("coverage", "pick"):
        Image.fromarray(redrawn[name]).save(REFERENCES / f"{name}.png", optimize=True)
