"""STEP files: unit, names of products, and a missing library."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.part_mesh import read_part
from tests.helpers.mesh_files import SIDES, step_of_a_box, written


@pytest.mark.parametrize(("prefix", "metres"), [(".MILLI.", 1e-3), (".CENTI.", 1e-2)])
def test_a_step_file_states_its_unit_and_names_its_bodies(
    tmp_path: Path, prefix: str, metres: float, capfd
) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("cascadio")
    text = step_of_a_box(f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))")

    part = read_part(written(tmp_path / "block.stp", text))

    assert part.size == pytest.approx(np.array(SIDES) * metres, rel=1e-6)
    assert part.groups["block"].all()
    assert any("unit stated by the file" in note for note in part.notes)
    assert capfd.readouterr().out == ""  # OpenCASCADE is kept from stdout


def test_step_without_its_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "cascadio", None)

    with pytest.raises(InputError, match=r"pip install 'chamberopt\[cad\]'"):
        read_part(written(tmp_path / "part.step", "ISO-10303-21;"))
