"""An evaluation comes back from its file as it was."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.simulation.evaluation import Evaluation, load_evaluation, save_evaluation
from tests.helpers.synthetic import plane_chamber, plate_design, poisson_evaluation


@pytest.fixture(scope="module")
def made_up() -> Evaluation:
    return poisson_evaluation(plate_design(), plane_chamber(), per_mm2=10.0, replicas=3)


def test_an_evaluation_comes_back_exactly(made_up: Evaluation, tmp_path: Path) -> None:
    save_evaluation(tmp_path / "one.npz", made_up)
    found = load_evaluation(tmp_path / "one.npz")
    for name, value in vars(made_up).items():
        if name != "hits":
            assert getattr(found, name) == value, name
    assert found.metrics["p05_coverage"].in_words == "not resolved"
    assert len(found.hits) == 3
    for one, other in zip(found.hits, made_up.hits, strict=True):
        for name, column in vars(other).items():
            np.testing.assert_array_equal(getattr(one, name), column)
            assert getattr(one, name).dtype == column.dtype


def test_a_file_of_another_version_or_a_damaged_one_is_refused(
    made_up: Evaluation, tmp_path: Path
) -> None:
    path = tmp_path / "one.npz"
    with pytest.raises(InputError, match="run the study in a new folder"):
        load_evaluation(path)
    save_evaluation(path, made_up)
    whole = path.read_bytes()
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    tree = arrays["tree"].tobytes().replace(b'"crease_share"', b'"patches_done"')
    np.savez(path, **arrays | {"tree": np.frombuffer(tree, dtype=np.uint8)})
    with pytest.raises(InputError, match=r"damaged.*patches_done"):
        load_evaluation(path)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="damaged"):
        load_evaluation(path)
