"""From Python: the names are there, and what is no design, study or result is named."""

import builtins
import io
import sys
from pathlib import Path
from types import ModuleType

import pytest
import trimesh

import chamberopt
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design, save_design
from chamberopt.peening.strip import StripSize
from chamberopt.workflows.strip import StripPlace
from tests.helpers.synthetic import plate_design


def test_the_names_are_listed() -> None:
    assert set(chamberopt.__all__) <= set(dir(chamberopt))


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("design", lambda folder: chamberopt.simulate("designs/gear.toml", folder)),  # type: ignore[arg-type]
        ("study", lambda folder: chamberopt.optimise({"vary": {}}, folder)),  # type: ignore[arg-type]
        ("study", lambda folder: chamberopt.sweep({"vary": {}}, folder, grid=2)),  # type: ignore[arg-type]
        ("result", lambda folder: chamberopt.show(folder)),  # type: ignore[arg-type]
    ],
)
def test_what_is_none_is_named_with_its_maker(name, call, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=rf"^{name}: given .*chamberopt\.load_{name}"):
        call(tmp_path / "out")
    assert not (tmp_path / "out").exists()


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_progress_is_shown_unless_it_is_not_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bars by default, nothing, or calls of a function: the figures are the same."""
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    brief = {"replicas": 3, "simulated_time_s": 0.05, "warmup_time_s": 0.01}
    design = plate_design(**{f"process__accuracy__{name}": value for name, value in brief.items()})
    calls: list[tuple[object, ...]] = []
    shown, found = {}, set()
    for name, progress in (
        ("bars", True), ("none", False), ("called", lambda *now: calls.append(now)),
    ):  # fmt: skip
        terminal = Terminal()
        monkeypatch.setattr(sys, "stderr", terminal)
        out = tmp_path / name
        result = chamberopt.simulate(design, out, ranges=False, workers=1, progress=progress)
        shown[name] = terminal.getvalue()
        found.add(result.objective.value)
    assert "building the chamber" in shown["bars"]
    assert "3/3" in shown["bars"]
    assert (shown["none"], shown["called"]) == ("", "")
    assert calls[-1] == (3, 3, None)
    assert len(found) == 1


def test_in_a_notebook_progress_is_drawn_as_in_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """As Jupyter's kernel is recognised: its stderr is no terminal."""
    from chamberopt.common import progress

    assert not progress._is_notebook()
    shell = type("ZMQInteractiveShell", (), {})()
    monkeypatch.setattr(builtins, "get_ipython", lambda: shell, raising=False)
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    for spec, drawn in ((object(), True), (None, False)):  # without ipywidgets: lines of a log
        monkeypatch.setattr(progress, "find_spec", lambda _, spec=spec: spec)
        assert progress._is_notebook() is drawn


def test_designs_are_compared_and_a_strip_is_peened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same workflows as those of the command line, in folders of their own."""
    for module in ("save_run", "comparison_folder"):
        monkeypatch.setattr(f"chamberopt.workflows.{module}.draw_coverage", lambda *_: None)
    brief = {"replicas": 4, "simulated_time_s": 0.05, "warmup_time_s": 0.01}
    values = {f"process__accuracy__{name}": value for name, value in brief.items()}
    paths = [tmp_path / "first.toml", tmp_path / "second.toml"]
    for path, mass in zip(paths, (4.0, 6.0), strict=True):
        save_design(plate_design(shot__mass_g=mass, **values), path)

    found = chamberopt.compare(paths, tmp_path / "compared", workers=1)
    assert found.labels == ("first", "second")
    assert found.parameters["shot.mass_g"] == (4.0, 6.0)
    assert (tmp_path / "compared" / "compare.json").is_file()

    place = StripPlace(size=StripSize(0.03, 0.03, is_disc=True))
    peened = chamberopt.peen_strip(load_design(paths[0]), tmp_path / "strip", place, workers=1)
    assert not peened.is_calibrated
    assert peened.intensity.value > 0.0
    assert (tmp_path / "strip" / "strip.json").is_file()


def test_a_first_design_is_proposed_as_by_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("chamberopt.workflows.propose.draw_target", lambda *_: "no picture")
    part, out = tmp_path / "box.stl", tmp_path / "box"
    trimesh.creation.box((20, 20, 30)).export(part)
    quiet = {"pilot": False, "progress": False}
    with pytest.raises(InputError, match="does not state the unit"):
        chamberopt.propose(part, out, **quiet)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="--intensity: it takes pilot runs"):
        chamberopt.propose(part, out, intensity="0.2-0.3A", **quiet)  # type: ignore[arg-type]
    assert not out.exists()
    design = chamberopt.propose(part, out, unit="mm", material="42CrMo4", **quiet)  # type: ignore[arg-type]
    assert design.materials.part.alloy == "42CrMo4"
    assert sorted(one.name for one in out.iterdir()) == ["design.toml", "study.toml"]
    assert chamberopt.load_study(out / "study.toml").design == design
    assert capfd.readouterr() == ("", "")
