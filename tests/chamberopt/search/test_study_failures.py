"""What can go wrong while a study runs.

Nothing on record is lost, the message says what happened, and the study can continue.
"""

import errno
import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest

import chamberopt
from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.cli.interrupt import EARLY, FIRST, SECOND
from chamberopt.common.estimate import Estimate
from chamberopt.design.load import save_design
from chamberopt.results.load import load_result
from chamberopt.search.judge import FAILURE_PENALTY
from chamberopt.search.study import load_study
from chamberopt.simulation.evaluation import Evaluation
from tests.helpers.results.resumable_study import calls, history, logged, run, study
from tests.helpers.synthetic import plate_design, poisson_evaluation

fork = (
    multiprocessing.get_context("fork")
    if "fork" in multiprocessing.get_all_start_methods()
    else None
)
needs_fork = pytest.mark.skipif(fork is None, reason="needs fork")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the study when nothing goes wrong."""
    folder = tmp_path_factory.mktemp("study") / "whole"
    run(study(), folder)
    return folder


@pytest.fixture
def expected(whole: Path) -> bytes:
    return history(whole)


def failing(folder: Path, at: int, error: Callable[[], BaseException], times: int = 1):
    """The simulator of a folder; its call number `at` and the next raise."""
    good, left = logged(folder.with_name(f"{folder.name}-calls.log")), [times]

    def simulator(design, stream, replicas):
        if len(calls(folder)) >= at and left[0]:
            left[0] -= 1
            raise error()
        return good(design, stream, replicas)

    return simulator


class TestFullDisk:
    @pytest.mark.long
    def test_no_room_for_a_row(
        self, tmp_path: Path, expected: bytes, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Wherever in a study the disk fills up: search, confirmation's file, its row."""
        for full_after in (0, 1, 5, 21, 25, 27):
            folder, synced = tmp_path / str(full_after), [0]

            def sync(file: int, full_after: int = full_after, synced: list[int] = synced) -> None:
                synced[0] += 1
                if synced[0] > full_after:
                    raise OSError(errno.ENOSPC, "No space left on device")

            with monkeypatch.context() as patch:
                patch.setattr("os.fsync", sync)
                with pytest.raises(OSError, match="No space left"):
                    run(study(), folder)
            kept = history(folder) if (folder / "history.jsonl").exists() else b""
            assert expected.startswith(kept)
            assert kept.endswith(b"\n") or not kept
            run(study(), folder)
            assert history(folder) == expected

    @needs_fork
    def test_a_row_that_fits_in_part(self, tmp_path: Path, expected: bytes) -> None:
        """The system's own refusal, in the middle of a row: a limit on the size of files."""
        import resource

        folder, room = tmp_path / "out", len(expected) // 2

        def limited() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
            run(study(), folder)

        child = fork.Process(target=limited)
        child.start()
        child.join(60)
        assert child.exitcode == 1
        kept = history(folder)
        assert expected.startswith(kept)
        assert room - 2000 < len(kept) <= room
        assert kept.endswith(b"\n")  # what had been written of the next was taken back
        run(study(), folder)
        assert history(folder) == expected


@pytest.mark.parametrize(
    "error",
    [ZeroDivisionError, pytest.param(MemoryError, marks=pytest.mark.long), KeyboardInterrupt],
)
@pytest.mark.parametrize("at", [pytest.param(5, marks=pytest.mark.long), 17])
def test_a_fault_of_ours_stops_the_study_not_the_candidate(
    error: type[BaseException], at: int, tmp_path: Path, whole: Path
) -> None:
    folder = tmp_path / "out"
    with pytest.raises(error) as raised:
        run(study(), folder, simulator=failing(folder, at, error))
    assert history(folder).count(b"\n") == at
    if issubclass(error, Exception):
        (note,) = raised.value.__notes__
        assert note.startswith(
            f"in evaluation {at + 1} ({'search' if at < 16 else 'confirm'}): chamber.height_mm = "
        )
    run(study(), folder)
    assert history(folder) == history(whole)
    assert len(calls(folder)) == len(calls(whole))


def test_no_number_is_no_score(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    good = logged(folder.with_name("out-calls.log"))

    def simulator(design, stream, replicas):
        evaluation = good(design, stream, replicas)
        return (
            replace(evaluation, objective=Estimate(math.nan, math.nan))
            if len(calls(folder)) == 4
            else evaluation
        )

    result = run(study(), folder, simulator=simulator)
    assert (result.trials[3].objective, result.trials[3].score) == (
        None,
        result.trials[0].score - FAILURE_PENALTY,
    )
    assert "nan" in result.trials[3].reason
    assert run(study(), folder).trials == result.trials


def study_whose_worker_dies(folder: Path, deaths: int) -> None:
    """Run the study; real worker processes end without a word, each in a pool to be replaced."""
    good, left = logged(folder.with_name(f"{folder.name}-calls.log")), [deaths]

    def simulator(design, stream, replicas):
        if len(calls(folder)) == 5 and left[0]:
            left[0] -= 1
            with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
                pool.submit(os._exit, 1).result()
        return good(design, stream, replicas)

    try:
        run(study(), folder, simulator=simulator)
    except BrokenExecutor as error:
        print(*error.__notes__)


def rows(text: bytes) -> list[object]:
    """The rows of a history. The order of their keys is that of a process."""
    return [json.loads(line) for line in text.splitlines()]


class TestWorkerThatDies:
    """The study runs in a process of its own: a worker of the tests has gone down with its pool."""

    def said_of(self, folder: Path, deaths: int) -> str:
        own = study_whose_worker_dies
        call = f"{own.__name__}(Path({str(folder)!r}), {deaths})"
        code = f"from pathlib import Path; from {own.__module__} import {own.__name__}; {call}"
        root = Path(__file__).parents[3]
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=root, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def test_once_is_made_good(self, tmp_path: Path, expected: bytes) -> None:
        assert not self.said_of(tmp_path / "out", 1)
        assert rows(history(tmp_path / "out")) == rows(expected)

    def test_twice_is_said(self, tmp_path: Path, expected: bytes) -> None:
        folder = tmp_path / "out"
        assert "in evaluation 6 (search): chamber.height_mm" in self.said_of(folder, 2)
        assert history(folder).count(b"\n") == 5
        run(study(), folder)
        assert rows(history(folder)) == rows(expected)


STUDY = """
design = "plate.toml"
[vary]
"shot.mass_g" = [1.5, 8.0]
[optimizer]
batch = 1
first_replicas = 0
confirm_rounds = 1
evaluations = 5
confirm = 1
confirm_replicas = 3
"""
ROWS = 7  # five searched, then the start and the best confirmed


class TestCommandLine:
    """`chamberopt run` with a simulator of milliseconds; all around it is real."""

    known: ClassVar[dict[tuple[str, str], Evaluation]] = {}  # by design and stream of seeds

    @pytest.fixture
    def evaluated(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list:
        """Every evaluation, as (stream, mass).

        A function under the key "at" + its number is called during that evaluation.
        """
        monkeypatch.chdir(tmp_path)
        Path("small.toml").write_text(STUDY)
        plate = plate_design(process__accuracy__points=1000)
        save_design(plate, Path("plate.toml"))
        chamber = build_chamber(plate)
        done: list = []

        def simulator(design, stream, replicas):
            done.append((stream, design.shot.mass_g))
            self.at.get(len(done), lambda: None)()
            key = design.model_dump_json(), stream
            if key not in self.known:  # most tests evaluate the same candidates
                self.known[key] = poisson_evaluation(
                    design, chamber, 4.0 * design.shot.mass_g, 3, seed=len(stream)
                )
            return self.known[key]

        self.at: dict[int, Callable[[], None]] = {}
        monkeypatch.setattr("chamberopt.search.run_study.ChamberSimulator", lambda *_: simulator)
        monkeypatch.setattr("chamberopt.workflows.optimise.study_ranges", lambda *_: None)
        # A forked process has none of the threads that manifold cuts with, and would wait for them.
        monkeypatch.setattr("chamberopt.workflows.optimise.build_chamber", lambda *_: chamber)
        monkeypatch.setattr("chamberopt.cli.teller.compile_with_message", lambda *_: None)
        monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        return done

    def rows(self, folder: str = "out") -> int:
        return Path(folder, "history.jsonl").read_text().count("\n")

    def test_ctrl_c_once_finishes_the_evaluation(
        self, evaluated: list, capfd: pytest.CaptureFixture[str]
    ) -> None:
        self.at[3] = lambda: os.kill(os.getpid(), signal.SIGINT)
        before = signal.getsignal(signal.SIGINT)
        assert main(["run", "small.toml", "--evaluations", "4", "--time=1m", "--out", "out"]) == 130
        err = capfd.readouterr().err
        assert FIRST in err
        resume = "chamberopt run small.toml --time 60s --evaluations 4 --out out"
        assert err.splitlines()[-1] == f"to resume: {resume}"
        assert (self.rows(), len(evaluated)) == (3, 3)
        assert signal.getsignal(signal.SIGINT) is before
        assert main(["run", "small.toml", "--out", "out"]) == 2  # not what was begun
        assert main(resume.split()[1:]) == 0
        out, err = capfd.readouterr()
        assert "out: resuming after 3 evaluations" in err
        assert "gain" in out
        assert len(evaluated) == len(set(evaluated)) == self.rows() == ROWS - 1
        ran = load_study("out/study.toml")
        assert (ran.optimizer.evaluations, ran.design.process.treatment_time) == (4, 60.0)

    def test_ctrl_c_finishes_all_that_runs(self, evaluated: list) -> None:
        """The third and the fourth run when it comes, and the third ends last."""
        study, at_a_time = Path("small.toml"), threading.Barrier(2)

        def interrupt() -> None:
            at_a_time.wait(20)
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)

        self.at.update({3: interrupt, 4: lambda: at_a_time.wait(20)})
        study.write_text(STUDY.replace("batch = 1", "batch = 2"))
        assert main(["run", "small.toml", "--out", "out"]) == 130
        assert (self.rows(), len(evaluated)) == (4, 4)
        assert main(["run", "small.toml", "--out", "out"]) == 0
        assert len(evaluated) == len(set(evaluated)) == self.rows() == ROWS

    @needs_fork
    def test_ctrl_c_twice_stops_at_once(
        self, evaluated: list, capfd: pytest.CaptureFixture[str]
    ) -> None:
        def twice() -> None:
            for seconds in (1.0, 20.0):  # the main thread takes one signal at a time
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(seconds)
            raise AssertionError("went on after the second Ctrl-C")

        self.at[3] = twice
        child = fork.Process(target=main, args=(["run", "small.toml", "--out", "out"],))
        child.start()
        child.join(60)
        err = capfd.readouterr().err
        assert child.exitcode == 130, err
        assert (
            err.index(FIRST)
            < err.index(SECOND)
            < err.index("to resume: chamberopt run small.toml --out out")
        )
        assert self.rows() == 2
        self.at.clear()
        assert main(["run", "small.toml", "--out", "out"]) == 0
        assert len(evaluated) == ROWS - 2

    @needs_fork
    def test_ctrl_c_before_the_first_evaluation_leaves_nothing(
        self, evaluated: list, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The signal may come at any moment.

        An exception would be dropped during an import, and would crash the compiler.
        """
        monkeypatch.setattr(
            "chamberopt.cli.teller.compile_with_message",
            lambda *_: os.kill(os.getpid(), signal.SIGINT),
        )
        child = fork.Process(target=main, args=(["run", "small.toml"],))
        child.start()
        child.join(60)
        assert (child.exitcode, EARLY in capfd.readouterr().err) == (130, True)
        monkeypatch.setattr("chamberopt.cli.teller.compile_with_message", lambda *_: None)
        assert main(["run", "small.toml"]) == 0
        assert [path.name for path in Path("results").iterdir()] == ["small"]

    def test_a_full_disk(
        self, evaluated: list, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(_: int) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        self.at[4] = lambda: monkeypatch.setattr("os.fsync", full)
        assert main(["run", "small.toml", "--out", "out"]) == 1
        *_, what, how = capfd.readouterr().err.splitlines()
        assert what == f"{Path('out/history.jsonl')}: No space left on device"
        assert how == "to resume: chamberopt run small.toml --out out"
        assert self.rows() == 3

    @pytest.mark.parametrize(
        ("error", "said"), [(MemoryError, "out of memory"), (BrokenExecutor, "worker process died")]
    )
    def test_the_machines_faults_are_one_message(
        self, error: type[Exception], said: str, evaluated: list, capfd: pytest.CaptureFixture[str]
    ) -> None:
        def fail() -> None:
            raise error

        self.at = {4: fail, 5: fail}
        assert main(["run", "small.toml", "--out", "out"]) == 1
        what, which, how = capfd.readouterr().err.splitlines()[-3:]
        assert said in what
        assert which.startswith("in evaluation 4 (search): shot.mass_g = ")
        assert how == "to resume: chamberopt run small.toml --out out"

    def test_a_bug_shows_where_it_was_and_how_to_go_on(self, evaluated: list) -> None:
        def fail() -> None:
            raise ZeroDivisionError

        self.at[2] = fail
        with pytest.raises(ZeroDivisionError) as raised:
            main(["run", "small.toml", "--out", "out"])
        assert raised.value.__notes__[1] == "to resume: chamberopt run small.toml --out out"

    @pytest.mark.parametrize(
        "step",
        [
            "results.write.write_coverage",
            pytest.param("results.write.write_chamber", marks=pytest.mark.long),
            pytest.param("workflows.save_run.draw_coverage", marks=pytest.mark.long),
        ],
    )
    def test_stopped_while_it_writes_its_results(
        self, step: str, evaluated: list, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(*_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        with monkeypatch.context() as patch:
            patch.setattr(f"chamberopt.{step}", full)
            assert main(["run", "small.toml", "--out", "out"]) == 1
        assert len(evaluated) == ROWS
        assert not Path("out/result.json").exists()
        assert main(["run", "small.toml", "--out", "out"]) == 0
        assert len(evaluated) == ROWS
        assert load_result("out").record.kind == "study"

    def test_a_finished_study_is_shown_not_run(
        self, evaluated: list, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert main(["run", "small.toml", "--out", "out"]) == 0
        before = {path: path.read_bytes() for path in Path("out").rglob("*") if path.is_file()}
        capfd.readouterr()
        monkeypatch.setattr(
            "chamberopt.common.versions.sources_digest", lambda: "another"
        )  # its result stands
        assert main(["run", "small.toml", "--out", "out"]) == 0
        out, err = capfd.readouterr()
        assert (
            "out: this study is finished, nothing was run; to run it again, give another folder "
            "(--out)" in err
        )
        assert "uniform coverage" in out
        assert len(evaluated) == ROWS
        assert {
            path: path.read_bytes() for path in Path("out").rglob("*") if path.is_file()
        } == before
        Path("small.toml").write_text(STUDY.replace("evaluations = 5", "evaluations = 6"))
        assert main(["run", "small.toml", "--out", "out"]) == 2
        assert "study.optimizer.evaluations: was 5, is 6" in capfd.readouterr().err

    @pytest.mark.long
    def test_comments_change_nothing(self, evaluated: list) -> None:
        self.at[3] = lambda: os.kill(os.getpid(), signal.SIGINT)
        assert main(["run", "small.toml", "--out", "out"]) == 130
        Path("small.toml").write_text("# as before\n" + STUDY.replace("8.0]", "8]  # g"))
        assert main(["run", "small.toml", "--out", "out"]) == 0
        assert load_study("out/study.toml") == load_study("small.toml")

    def test_without_out_it_begins_anew_and_says_what_is_unfinished(
        self, evaluated: list, capfd: pytest.CaptureFixture[str]
    ) -> None:
        self.at[3] = lambda: os.kill(os.getpid(), signal.SIGINT)
        assert main(["run", "small.toml"]) == 130
        first = Path("results", "small")
        assert f"to resume: chamberopt run small.toml --out {first}" in capfd.readouterr().err
        assert main(["run", "small.toml"]) == 0
        assert (
            f"{first}: not finished; to resume it: chamberopt run small.toml --out {first}"
            in capfd.readouterr().err
        )
        assert self.rows("results/small") == 3
        assert self.rows("results/small-2") == ROWS

    @pytest.mark.long
    def test_from_python_too(self, evaluated: list) -> None:
        self.at[3] = lambda: signal.raise_signal(signal.SIGINT)  # no handler of ours there
        with pytest.raises(KeyboardInterrupt):
            chamberopt.optimise(load_study("small.toml"), "out", workers=1)
        self.at.clear()
        evaluated.pop()
        first = chamberopt.optimise(load_study("small.toml"), "out", workers=1)
        assert chamberopt.optimise(load_study("small.toml"), "out", workers=1) == first
        assert len(evaluated) == len(set(evaluated)) == ROWS
