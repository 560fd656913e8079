"""Published saturation curves: what was published is found, what is missed or wrong is told."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.saturation_sets import SHIPPED, is_within, main, read_sets, row

SET = """
[[set]]
name = "mine"
source = "made up"
exposure = {exposure}
arc_height = {heights}
intensity = {intensity}
intensity_tolerance = 1.0
"""


def written(folder: Path, **values: object) -> Path:
    times = np.array([1.0, 2.0, 4.0, 8.0])
    exact = {
        "exposure": times.tolist(),
        "heights": (10.0 * -np.expm1(-0.8 * times)).tolist(),
        "intensity": 9.0,
    }
    path = folder / "sets.toml"
    path.write_text(SET.format(**{**exact, **values}), encoding="utf-8")
    return path


def test_an_exact_curve_has_nine_tenths_of_its_end(tmp_path: Path) -> None:
    """h = 10 (1 - exp(-0.8 t)): intensity 9 at T = ln 10 / 0.8."""
    (one,) = read_sets(written(tmp_path))
    found = row(one)
    assert found["intensity, two"] == found["intensity, three"] == "9.00"
    assert float(found["T, two"]) == pytest.approx(np.log(10.0) / 0.8, rel=1e-3)
    assert found["a curve"] == "yes"
    assert main([str(written(tmp_path))]) == 0


def test_a_missed_intensity_and_a_short_curve_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(written(tmp_path, intensity=7.9))]) == 1
    assert "NO" in capsys.readouterr().out
    short = written(tmp_path, exposure=[0.5, 1.0, 2.0, 4.0], heights=[3.3, 5.5, 7.98, 9.59])
    assert main([str(short)]) == 0
    assert "no: too short" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"heights": [1, 2, 3]}, "set.0.arc_height"),
        ({"exposure": [1, 2, 2, 4]}, "ascending"),
        ({"exposure": [0, 1, 2, 4]}, "set.0.exposure.0"),
        ({"intensity": "nan"}, "set.0.intensity"),
        ({"intensity": "'much'"}, "set.0.intensity"),
    ],
)
def test_a_wrong_file_is_told_by_its_field(
    values: dict, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(written(tmp_path, **values))]) == 2
    assert told in capsys.readouterr().err


def test_the_readable_set_of_the_standard_is_found() -> None:
    (one,) = [one for one in read_sets(SHIPPED) if one.name.startswith("SAE J2597")]
    found = row(one)
    assert is_within(one, float(found["intensity, two"]))
    assert is_within(one, float(found["intensity, three"]))
    assert abs(float(found["intensity, two"]) - one.intensity) < 0.1  # a tenth of the tolerance
