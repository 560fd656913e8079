"""Two designs side by side: what differs is named, and a difference carries its interval."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt import viewer
from chamberopt.chamber import build_chamber
from chamberopt.compare import compare, write_comparison
from chamberopt.config import load_design
from chamberopt.errors import InputError
from chamberopt.results import write_simulation
from tests.synthetic import DESIGNS, plate_design, poisson_evaluation

PLATE = plate_design()
CHAMBER = build_chamber(PLATE)


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "coverage_picture", lambda *_: "skipped")


def left(folder: Path, per_mm2: float, seed: int = 0, design=PLATE) -> Path:
    write_simulation(folder, design, CHAMBER, poisson_evaluation(design, CHAMBER, per_mm2, 6, seed))
    return folder


def test_the_same_twice(tmp_path: Path) -> None:
    both = compare([left(tmp_path / "a", 20), left(tmp_path / "b", 20)])
    assert both.parameters == {}
    for name, (difference,) in both.differences.items():
        assert difference.value == 0.0
        if name not in ("p05_coverage", "time_to_98_s"):  # their intervals hold a bias that knows nothing of pairs
            assert difference.half_width == 0.0
    assert "the designs do not differ" in both.as_text()
    assert " *" not in both.as_text().splitlines()[2]


def test_what_differs_is_named_and_measured(tmp_path: Path) -> None:
    heavier = plate_design(shot__mass_g=6.0, process__seed=2)
    both = compare([left(tmp_path / "light", 10), left(tmp_path / "heavy", 30, 1, heavier)])
    assert both.parameters["shot.mass_g"] == (PLATE.shot.mass_g, 6.0)
    assert set(both.parameters) == {"shot.mass_g", "process.seed"}
    assert both.labels == ("light", "heavy")
    first, second = both.metrics["mean_coverage"]
    (difference,) = both.differences["mean_coverage"]
    assert difference.value == pytest.approx(second.value - first.value)
    assert difference.value > difference.half_width > 0  # three times the dents
    # Other seeds: independent, so the variances add.
    assert difference.half_width == pytest.approx(np.hypot(first.half_width, second.half_width), rel=0.3)
    row = next(line for line in both.as_text().splitlines() if line.startswith("mean_coverage"))
    assert row.endswith("*")


def test_three_results_and_what_is_written(tmp_path: Path) -> None:
    folders = [left(tmp_path / name / "result", 10 + 10 * i, i) for i, name in enumerate("abc")]
    three = compare(folders)
    assert three.labels == ("a/result", "b/result", "c/result")
    assert len(three.differences["mean_coverage"]) == 2
    assert write_comparison(tmp_path / "out", three) == ["skipped"]
    assert (tmp_path / "out" / "compare.txt").read_text() == three.as_text() + "\n"
    with pytest.raises(InputError, match="never overwritten"):
        write_comparison(tmp_path / "out", three)


def test_what_cannot_be_compared(tmp_path: Path) -> None:
    one = left(tmp_path / "one", 20)
    with pytest.raises(InputError, match="two or more"):
        compare([one])
    with pytest.raises(InputError, match="not a results folder"):
        compare([one, tmp_path])
    blade = load_design(DESIGNS / "blade.toml")
    other = build_chamber(blade)
    write_simulation(tmp_path / "blade", blade, other, poisson_evaluation(blade, other))
    with pytest.raises(InputError, match=r"another part \(blade.stl\).*plate.stl"):
        compare([one, tmp_path / "blade"])
    part = PLATE.part.model_copy(update={"target": type(PLATE.part.target)()})
    elsewhere = left(tmp_path / "all", 20, 0, PLATE.model_copy(update={"part": part}))
    with pytest.raises(InputError, match=r"part\.target differs"):
        compare([one, elsewhere])
