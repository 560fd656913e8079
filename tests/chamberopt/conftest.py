"""Results that several tests of this folder look at."""

from pathlib import Path

import pytest

from chamberopt.results.arrays_file import ResultArrays, save_result_arrays
from chamberopt.results.vtp_files import write_chamber, write_coverage
from chamberopt.simulation.field_values import complete_result
from chamberopt.viewer.opened_result import ResultInfo
from tests.helpers.results.sphere_in_sphere import ball_result
from tests.helpers.synthetic import plate_design, plate_evaluation

DESIGN = plate_design()


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple:
    """Folder, chamber, evaluation and complete result of the plate with random dents."""
    folder = tmp_path_factory.mktemp("viewer") / "a plate, simulated"
    folder.mkdir()
    chamber, evaluation = plate_evaluation()
    found = complete_result(DESIGN, chamber, evaluation)
    arrays = ResultArrays(chamber, found.element_values, found.display)
    save_result_arrays(folder, arrays)
    write_coverage(folder, arrays.part, arrays.field)
    write_chamber(folder, chamber)
    return folder, chamber, evaluation, found


@pytest.fixture
def ball(tmp_path: Path) -> ResultInfo:
    return ball_result(tmp_path / "ball")
