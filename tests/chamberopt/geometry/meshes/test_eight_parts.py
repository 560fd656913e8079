"""The parts that engineers have are read as they are, with their sizes and names."""

import math
from pathlib import Path

import numpy as np
import pytest

from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.step_tessellation import Tessellation
from tests.helpers.eight_parts import EIGHT_PARTS, KEPT_ASIDE
from tests.helpers.four_parts import FOUR_PARTS
from tests.helpers.more_parts import MORE_PARTS

COARSE = Tessellation(1e-4, math.radians(25.0))
PARTS = {**EIGHT_PARTS, **KEPT_ASIDE, **FOUR_PARTS, **MORE_PARTS}


@pytest.mark.parametrize("name", sorted(PARTS))
def test_a_part_is_read_with_its_size_and_its_targets_name(tmp_path: Path, name: str) -> None:
    given = PARTS[name]
    path = given.write(tmp_path)
    if path.suffix == ".step":
        pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

    part = read_part(path, given.unit or "guess", COARSE if path.suffix == ".step" else None)

    assert 1e3 * np.sort(part.size) == pytest.approx(np.sort(given.size_mm), abs=0.06)
    if given.target:
        assert 0 < part.groups[given.target].sum() < len(part.triangles)
    assert not [one for one in part.groups if "translator" in one]  # no name of a part
    dropped = [note for note in part.notes if "dropped 1 stray triangle of no" in note]
    assert len(dropped) == (name == "scan_stray")
