"""Where no picture can be drawn, one line says why, and the process goes on."""

import sys
from pathlib import Path

import pytest

from chamberopt.pictures import subprocess_drawing
from chamberopt.pictures.coverage import draw_coverage
from tests.helpers.opengl import needs_opengl


def test_without_an_opengl_library_one_line_says_what_to_install(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subprocess_drawing.sys, "platform", "linux")
    monkeypatch.setattr(subprocess_drawing, "offscreen_window", lambda: None)
    remark = draw_coverage([case[0]], ["plate"], tmp_path / "coverage.png")
    assert remark is not None
    assert "coverage.png skipped" in remark
    assert "libegl1" in remark
    assert "\n" not in remark


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL vendors are a Linux matter")
@needs_opengl
def test_an_opengl_library_without_a_driver_costs_the_picture_only(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # VTK does not raise here, it dies of a segmentation fault: seen with libEGL but no vendor.
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent")
    remark = draw_coverage([case[0]], ["plate"], tmp_path / "coverage.png")
    assert remark is not None
    assert "libegl1" in remark
    assert "\n" not in remark
    assert not list(tmp_path.iterdir())


def test_a_drawing_that_fails_costs_the_picture_only_and_one_line_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subprocess_drawing, "missing_opengl", lambda: "")
    with pytest.raises(TypeError) as raised:
        float({})  # type: ignore[arg-type]
    remark = subprocess_drawing.draw_in_subprocess(float, {}, tmp_path / "new.png")
    assert remark == f"new.png skipped: drawing failed (TypeError: {raised.value})"
    assert not list(tmp_path.iterdir())
