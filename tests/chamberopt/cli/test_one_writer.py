"""Every command that writes claims its output first: whoever comes second is told at once."""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import pytest

import chamberopt
from chamberopt.cli import main
from chamberopt.common.errors import OutputTakenError
from chamberopt.common.files import claim_file, claim_folder, write_text
from chamberopt.design.load import save_design
from tests.helpers.results.short_plate import plate_result
from tests.helpers.synthetic import plate_design


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a design, a study and a result."""
    place = tmp_path_factory.mktemp("here")
    save_design(plate_design(), place / "plate.toml")
    write_text(place / "s.toml", 'design = "plate.toml"\n[vary]\n"shot.mass_g" = [2.0, 6.0]\n')
    plate_result(place / "result")
    return place


def claimed(path: Path) -> AbstractContextManager[Path]:
    return claim_file(path) if path.suffix else claim_folder(path)


@pytest.mark.parametrize(
    ("command", "output"),
    [
        ("simulate plate.toml --no-ranges --out out", "out"),
        ("run s.toml --out out", "out"),
        ("sweep s.toml --grid 2 --out out", "out"),
        ("compare plate.toml plate.toml --out out", "out"),
        ("accuracy plate.toml --out out", "out"),
        ("strip plate.toml --disc-mm 40 --out out", "out"),
        ("check plate.toml --out out", "out"),
        ("check plate.toml --screenshot check.png", "check.png"),
        ("report result", "result/report.html"),
        ("report result --out page.html", "page.html"),
        ("inspect result --screenshot view.png", "view.png"),
        ("inspect result --html page.html", "page.html"),
        ("inspect result --off-screen --out out", "out"),
        ("export result --to fields-vtp --out out", "out"),
        ("export result --to fields-vtp --out fields.vtp", "fields.vtp"),
        ("dents result dents.png", "dents.png"),
        ("replay result film.gif", "film.gif"),
    ],
)
def test_the_second_is_told_at_once(
    command: str, output: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    def never(*_: object, **__: object) -> None:
        pytest.fail("it worked before it claimed its output")

    monkeypatch.chdir(folder)
    for module in ("workflows.simulate", "workflows.optimise", "chamber.build"):
        monkeypatch.setattr(f"chamberopt.{module}.build_chamber", never)
    monkeypatch.setattr("chamberopt.common.child.subprocess.Popen", never)
    before = sorted(folder.rglob("*"))
    with claimed(Path(output)):
        assert main(command.split()) == 2
    message = capsys.readouterr().err
    assert f"{output}: is being written by process " in message
    assert "; wait until it ends, or choose another " in message
    assert message.count("\n") == 1
    assert sorted(folder.rglob("*")) == before  # nothing is left behind


@pytest.mark.parametrize(
    ("command", "first"),
    [
        ("simulate plate.toml", "results/plate"),
        ("accuracy plate.toml", "results/plate-accuracy"),
        ("run s.toml", "results/s"),
    ],
)
def test_a_default_folder_that_is_held_is_passed_over(
    command: str, first: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even an empty one, whose holder has not begun to write."""

    class Begun(Exception):  # noqa: N818
        pass

    def begin(*_: object, **__: object) -> None:
        raise Begun

    monkeypatch.chdir(folder)
    for module in ("workflows.simulate", "workflows.optimise", "chamber.build"):
        monkeypatch.setattr(f"chamberopt.{module}.build_chamber", begin)
    monkeypatch.setattr("chamberopt.workflows.accuracy.run_convergence_study", begin)
    seen: list[list[Path]] = []
    real = ExitStack.enter_context

    def enter(stack: ExitStack, manager: AbstractContextManager) -> object:
        entered = real(stack, manager)
        seen.append(sorted(Path("results").iterdir()))
        return entered

    monkeypatch.setattr(ExitStack, "enter_context", enter)
    with claim_folder(first), pytest.raises(Begun):
        main(command.split())
    assert seen[-1] == [Path(first), Path(f"{first}-2")]
    assert not Path("results").exists()


def test_from_python_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    with claim_folder("out"), pytest.raises(OutputTakenError, match="being written by process"):
        chamberopt.simulate(chamberopt.load_design("plate.toml"), "out")


class TestClaim:
    @pytest.mark.parametrize("claim", [claim_folder, claim_file])
    def test_it_ends_with_its_block_and_leaves_nothing(
        self, claim: Callable[[Path], AbstractContextManager], tmp_path: Path
    ) -> None:
        for _ in range(2):
            with claim(tmp_path / "new"), pytest.raises(OutputTakenError), claim(tmp_path / "new"):
                pass
        assert not list(tmp_path.iterdir())

    def test_what_is_written_stays(self, tmp_path: Path) -> None:
        with claim_folder(tmp_path / "a" / "b") as folder:
            write_text(folder / "x.txt", "x")
        assert [one.name for one in (tmp_path / "a" / "b").iterdir()] == ["x.txt"]
        with (
            pytest.raises(OutputTakenError, match="already holds files"),
            claim_folder(tmp_path / "a" / "b"),
        ):
            pass
        with claim_folder(tmp_path / "a" / "b", lambda folder: True) as folder:
            assert (folder / "x.txt").read_text() == "x"

    def test_an_empty_folder_that_was_there_stays(self, tmp_path: Path) -> None:
        with claim_folder(tmp_path):
            pass
        assert tmp_path.is_dir()
