"""A result's chamber and replicas are built again as they were simulated, or refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.output.resimulate.rebuild import rebuild_replica
from chamberopt.output.results.load import Result, load_result
from tests.helpers.results.short_plate import plate_result


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("rebuild") / "plate")


def test_a_target_chosen_by_a_study_is_the_results_own(result: Result) -> None:
    """With target.reachable the target is read from part.vtp, not derived from this chamber."""
    target = result.design.part.target.model_copy(update={"reachable": True})
    part = result.design.part.model_copy(update={"target": target})
    design = result.design.model_copy(update={"part": part})
    rebuilt = rebuild_replica(replace(result, design=design)).chamber.part.target
    np.testing.assert_array_equal(rebuilt, rebuild_replica(result).chamber.part.target)


def test_a_replica_or_a_part_that_is_not_there_is_refused(result: Result, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--replica: given 3; the result has 3, give 0 to 2"):
        rebuild_replica(result, 3)
    with pytest.raises(
        InputError,
        match=r"part\.mesh: .*plate\.stl: not what .*plate was simulated with; restore it",
    ):
        rebuild_replica(replace(result, part_sha256="0" * 64))
    other = result.design.changed({"chamber.diameter_mm": 51})
    with pytest.raises(InputError, match="chamber comes out differently now"):
        rebuild_replica(replace(result, design=other))


def test_a_changed_part_ends_with_one_sentence(result: Result, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    data = json.loads((result.folder / "result.json").read_text(encoding="utf-8"))
    folder = tmp_path / "copy"
    folder.mkdir()
    for name in ("part.vtp", "chamber.vtp"):
        (folder / name).write_bytes((result.folder / name).read_bytes())
    changed = tmp_path / "plate.stl"
    mesh = result.design.part.mesh_path.read_bytes()
    changed.write_bytes(
        mesh[:-1] + bytes([mesh[-1] ^ 1])
    )  # one bit of the last triangle's attribute
    data["design"]["part"]["mesh"] = str(changed)
    (folder / "result.json").write_text(json.dumps(data), encoding="utf-8")
    assert load_result(folder).design.part.mesh_path == changed
    assert main(["replay", str(folder), str(tmp_path / "a.gif")]) == 2
    assert "not what" in capsys.readouterr().err.strip().splitlines()[-1]
