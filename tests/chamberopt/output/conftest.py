"""Results that several tests of this folder look at."""

from pathlib import Path

import pytest
from chamberopt.simulation.triangle_fields import compute_triangle_fields

from chamberopt.chamber.build import build_chamber
from chamberopt.output.viewer import ResultInfo
from chamberopt.output.vtp_files import write_chamber, write_coverage
from tests.helpers.results.sphere_in_sphere import ball_result
from tests.helpers.synthetic import plate_design, poisson_evaluation

DESIGN = plate_design()


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple:
    folder = tmp_path_factory.mktemp("viewer") / "a plate, simulated"
    folder.mkdir()
    chamber = build_chamber(DESIGN)
    evaluation = poisson_evaluation(DESIGN, chamber)
    write_coverage(
        folder / "coverage.vtp",
        chamber,
        compute_triangle_fields(DESIGN, chamber, evaluation),
        "avrami",
    )
    write_chamber(folder, chamber)
    return folder, chamber, evaluation


@pytest.fixture
def ball(tmp_path: Path) -> ResultInfo:
    return ball_result(tmp_path / "ball")
