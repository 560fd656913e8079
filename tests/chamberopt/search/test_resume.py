"""A study that was stopped at any moment, by anything, ends as if it had not been stopped.

Its files have the same bytes, and no evaluation is done twice.
"""

import json
import multiprocessing
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.design.load import Design
from chamberopt.results.load import load_result
from chamberopt.search.study import Objective, Study
from chamberopt.search.study.parameters import Varied
from chamberopt.search.study_folder import StudyFolder, open_study_folder
from chamberopt.simulation.advice import Advice
from chamberopt.simulation.evaluation import Evaluation, load_evaluation, save_evaluation
from tests.helpers.results.resumable_study import GEAR, calls, history, logged, run, study
from tests.helpers.synthetic import DESIGNS, plate_design, poisson_evaluation

ALGORITHMS = [
    "auto", "GN_DIRECT_L", "GN_DIRECT_L_RAND", "GN_ORIG_DIRECT_L", "GN_MLSL_LDS", "GN_CRS2_LM",
    "GN_ISRES", "GN_ESCH", "GN_AGS", "LN_BOBYQA", "LN_COBYLA", "LN_SBPLX", "LN_NELDERMEAD",
    "LN_PRAXIS",
]  # fmt: skip


@pytest.fixture
def quick_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """No waiting for the disk: what is tested is what is written."""
    monkeypatch.setattr("os.fsync", lambda _: None)


def cut(whole: Path, folder: Path, length: int) -> None:
    """A copy of a study's folder whose history ends after so many bytes."""
    shutil.copytree(whole, folder)
    (folder / "history.jsonl").write_bytes(history(whole)[:length])


@pytest.mark.usefixtures("quick_disk")
@pytest.mark.parametrize(
    ("algorithm", "batch"),
    [*[(one, 1) for one in ALGORITHMS], pytest.param("auto", 3, marks=pytest.mark.long)],
)
def test_every_algorithm_goes_on_from_any_row(algorithm: str, batch: int, tmp_path: Path) -> None:
    whole, question = tmp_path / "whole", study(algorithm=algorithm, batch=batch)
    run(question, whole)
    ends = [0, *(at + 1 for at, byte in enumerate(history(whole)) if byte == ord("\n"))]
    rows = (
        (0, 1, 4, 5, 6, 9, 13, 16, 17, len(ends) - 2)
        if algorithm == "auto"
        else (1, 7, 13, len(ends) - 2)
    )
    for k in rows:
        folder = tmp_path / str(k)
        cut(whole, folder, ends[k])
        run(question, folder)
        assert history(folder) == history(whole), f"{k} rows were there"
        if batch == 1:
            assert calls(folder) == calls(whole)[k:]
        else:  # in any order
            assert len(calls(folder)) == len(calls(whole)) - k


@pytest.mark.usefixtures("quick_disk")
@pytest.mark.parametrize("batch", [pytest.param(1, marks=pytest.mark.long), 3])
@pytest.mark.parametrize(
    "objective",
    [{}, pytest.param({"pareto": ["uniform_coverage", "p05_coverage"]}, marks=pytest.mark.long)],
)
def test_what_is_learnt_from_few_replicas_is_learnt_again(
    objective: dict, batch: int, tmp_path: Path
) -> None:
    """Everything that a resumed study needs is read from the rows.

    That includes candidates given up after a few replicas, confirmations repeated with more, and
    two objectives.
    """
    question = study(first_replicas=4, confirm_rounds=3, batch=batch).model_copy(
        update={"objective": Objective(**objective)}
    )
    whole = tmp_path / "whole"
    first = run(question, whole)
    ends = [0, *(at + 1 for at, byte in enumerate(history(whole)) if byte == ord("\n"))]
    for k in sorted({3, 8, 14, 17, len(ends) - 2}):
        folder = tmp_path / str(k)
        cut(whole, folder, ends[k])
        again = run(question, folder)
        assert history(folder) == history(whole), f"{k} rows were there"
        assert (again.gain, again.best.parameters) == (first.gain, first.best.parameters)


@pytest.mark.usefixtures("quick_disk")
def test_a_row_torn_anywhere_is_a_row_to_do_again(tmp_path: Path) -> None:
    whole, question = tmp_path / "whole", study(evaluations=5, confirm=1)
    run(question, whole)
    for length in np.random.default_rng(0).integers(1, len(history(whole)), 12):
        folder = tmp_path / str(length)
        cut(whole, folder, int(length))
        run(question, folder)
        assert history(folder) == history(whole)
        assert len(calls(folder)) == len(calls(whole)) - history(whole)[:length].count(b"\n")


@pytest.mark.usefixtures("quick_disk")
def test_an_ended_study_is_read_not_run(tmp_path: Path) -> None:
    first = run(study(), tmp_path / "out")
    evaluated = calls(tmp_path / "out")
    again = run(study(), tmp_path / "out")
    assert calls(tmp_path / "out") == evaluated
    assert (again.trials, again.gain, again.seconds) == (first.trials, first.gain, first.seconds)
    assert (again.best.design, again.best.searched) == (first.best.design, first.best.searched)
    assert_same(again.best.evaluation, first.best.evaluation)
    assert_same(again.start.evaluation, first.start.evaluation)


fork = (
    multiprocessing.get_context("fork")
    if "fork" in multiprocessing.get_all_start_methods()
    else None
)


@pytest.mark.long
@pytest.mark.usefixtures("quick_disk")
@pytest.mark.skipif(fork is None, reason="needs fork")
def test_killed_at_twenty_random_moments(tmp_path: Path) -> None:
    """SIGKILL, and SIGKILL again while it goes on, then left alone."""
    question = study(evaluations=12, confirm=2, batch=2)

    def killed(folder: Path, after: float) -> bool:
        child = fork.Process(target=run, args=(question, folder))
        child.start()
        child.join(after)
        child.kill()
        child.join()
        return child.exitcode != 0

    began = time.perf_counter()
    assert not killed(tmp_path / "whole", 60.0)
    seconds = time.perf_counter() - began
    expected, evaluated = history(tmp_path / "whole"), calls(tmp_path / "whole")
    moments = np.random.default_rng(20).uniform(0.0, seconds, (20, 2))
    moments[0, 0] = 0.0  # before anything is on record, which takes a moment only
    kills, stages = 0, set()
    for number, (first, second) in enumerate(moments):
        folder = tmp_path / str(number)
        done = 0  # evaluations on record
        for after in (first, second, 60.0):
            before = len(calls(folder))
            kills += killed(folder, after)
            called = calls(folder)[before:]
            # It goes on where the record ends, and two of a batch are in any order.
            possible = evaluated[max(0, done - 1) : done + len(called) + 2]
            assert all(one in possible for one in called)
            done = history_rows(folder)
            stages.add("none" if done == 0 else "confirm" if done > 12 else "search")
        assert history(folder) == expected
        assert not list(folder.rglob(".writing-*"))
    assert kills >= 15
    assert stages == {"none", "search", "confirm"}


def assert_same(one: object, other: object) -> None:
    """Equal in every field, arrays in every bit."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    elif hasattr(one, "__dataclass_fields__"):
        for name in one.__dataclass_fields__:
            assert_same(getattr(one, name), getattr(other, name))
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        assert_same(tuple(one.values()), tuple(other.values()))
    else:
        assert one == other


class TestEvaluationFile:
    """A confirmation is stored whole.

    Results made from it equal those made from the simulated one.
    """

    @pytest.fixture
    def evaluation(self) -> Evaluation:
        design = plate_design()
        plain = poisson_evaluation(design, build_chamber(design), per_mm2=10.0)
        never = plain.metrics["time_to_98_s"].not_known("never")
        metrics = {**plain.metrics, "time_to_98_s": never}
        return replace(plain, notes=("µ ± 1", "x"), metrics=metrics)

    def test_reads_back_the_same(self, evaluation: Evaluation, tmp_path: Path) -> None:
        save_evaluation(tmp_path / "one.npz", evaluation)
        assert_same(load_evaluation(tmp_path / "one.npz"), evaluation)
        assert [path.name for path in tmp_path.iterdir()] == ["one.npz"]

    def test_damage_is_said(self, evaluation: Evaluation, tmp_path: Path) -> None:
        path = tmp_path / "one.npz"
        save_evaluation(path, evaluation)
        content = path.read_bytes()
        for damaged in (b"", b"PK", content[:1000], content[:2000] + b"\0" * 50 + content[2050:]):
            path.write_bytes(damaged)
            with pytest.raises(InputError, match=r"one\.npz.*new folder"):
                load_evaluation(path)
        path.unlink()
        with pytest.raises(InputError, match=r"one\.npz: not there"):
            load_evaluation(path)


@pytest.mark.usefixtures("quick_disk")
class TestDamage:
    """Damage that a crash cannot do is reported with file and line, not repaired.

    No file is written then.
    """

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        run(study(evaluations=6), tmp_path / "out")
        return tmp_path / "out"

    @pytest.mark.parametrize(
        ("line", "change", "said"),
        [
            (3, ("{", ""), r"history\.jsonl:3: damaged row"),
            (3, ('"score"', '"scare"'), r"history\.jsonl:3: damaged row"),
            (2, ('"number": 1', '"number": 5'), r"history\.jsonl:2: damaged row"),
            (2, ('"replicas": 4', '"replicas": 0'), r"history\.jsonl:2: damaged row"),
            (2, ('"highest": null', '"highest": 0.3'), r"history\.jsonl:2: damaged row"),
            (
                4,
                ('"point": [0.', '"point": [0.9'),
                r"history\.jsonl:4: recorded is the search of \[0\.9.*but the search now",
            ),
            (
                2,
                ('"stage": "search"', '"stage": "confirm"'),
                r"history\.jsonl:2: recorded is the confirm",
            ),
            (1, ("{", "7 #"), r"history\.jsonl:1: damaged row"),
        ],
    )
    def test_of_a_row(self, line: int, change: tuple[str, str], said: str, folder: Path) -> None:
        rows = history(folder).decode().splitlines(keepends=True)
        assert change[0] in rows[line - 1]
        rows[line - 1] = rows[line - 1].replace(*change, 1)
        (folder / "history.jsonl").write_text("".join(rows))
        done = calls(folder)
        with pytest.raises(InputError, match=said):
            run(study(evaluations=6), folder)
        assert (history(folder).decode(), calls(folder)) == ("".join(rows), done)

    def test_of_a_score(self, folder: Path) -> None:
        """The search itself tells: after another score it comes to another candidate."""
        rows = [json.loads(row) for row in history(folder).splitlines()]
        rows[2]["score"] += 0.3
        (folder / "history.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        with pytest.raises(
            InputError,
            match=r"history\.jsonl:\d: recorded is .*edited, or written by another version",
        ):
            run(study(evaluations=6), folder)

    def test_of_rows_too_many(self, folder: Path) -> None:
        last = json.loads(history(folder).splitlines()[-1])
        more = json.dumps({**last, "number": last["number"] + 1}) + "\n"
        (folder / "history.jsonl").write_bytes(history(folder) + more.encode())
        with pytest.raises(InputError, match="ended before this row"):
            run(study(evaluations=6), folder)

    def test_of_a_confirmation(self, folder: Path) -> None:
        path = folder / "confirm" / "006.npz"
        path.write_bytes(path.read_bytes()[:100])
        with pytest.raises(InputError, match=r"006\.npz: damaged"):
            run(study(evaluations=6), folder)

    @pytest.mark.parametrize(
        ("changed", "said"),
        [
            ({"replicas": "4"}, "of another type"),
            ({"objective": True}, "of another type"),
            ({"metrics": {}}, "metrics are not those"),
            ({"reachable": float("nan")}, "not finite"),
            ({"simulated_time": 0.0}, "no simulated time"),
            ({"hits": ()}, "impacts of 0 replicas, expected 4"),
            ({"objective": Estimate(0.5, 0.1, (0.5,))}, r"not the evaluation that row 7"),
        ],
    )
    def test_of_a_confirmation_that_is_forged(self, changed: dict, said: str, folder: Path) -> None:
        path = folder / "confirm" / "006.npz"
        save_evaluation(path, replace(load_evaluation(path), **changed))
        with pytest.raises(InputError, match=rf"006\.npz: .*{said}"):
            run(study(evaluations=6), folder)

    def test_of_parameters(self, folder: Path) -> None:
        rows = [json.loads(row) for row in history(folder).splitlines()]
        rows[2]["parameters"] = {"chamber.height_mm": 1.0}
        (folder / "history.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        with pytest.raises(InputError, match=r"history\.jsonl:3: damaged row"):
            run(study(evaluations=6), folder)

    def test_of_the_whole_history(self, folder: Path) -> None:
        (folder / "history.jsonl").unlink()
        (folder / "history.jsonl").mkdir()
        with pytest.raises(InputError, match=r"history\.jsonl: is a folder"):
            run(study(evaluations=6), folder)

    def test_of_what_was_asked(self, folder: Path) -> None:
        (folder / "inputs.json").write_text("{")
        with pytest.raises(InputError, match=r"inputs\.json: damaged"):
            run(study(evaluations=6), folder)

    def test_of_the_timings_costs_no_evaluation(self, folder: Path) -> None:
        (folder / "timings.jsonl").unlink()
        done = calls(folder)
        assert run(study(evaluations=6), folder).seconds == 0.0
        assert calls(folder) == done


@pytest.mark.usefixtures("quick_disk")
class TestChanges:
    """A folder belongs to one study, run by one version of the program."""

    def test_a_folder_of_version_0_1_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "asked.json").write_text("{}", encoding="utf-8")
        with pytest.raises(InputError, match=r"run by version 0\.1.*give another folder"):
            run(study(), tmp_path)

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        """A study stopped after three evaluations."""
        run(study(), tmp_path / "whole")
        cut(tmp_path / "whole", tmp_path / "out", history(tmp_path / "whole").find(b'{"number": 3'))
        return tmp_path / "out"

    def refused(self, question: Study, folder: Path) -> str:
        before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        with pytest.raises(InputError, match="began otherwise") as refusal:
            run(question, folder)
        assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
        return str(refusal.value)

    def test_of_the_study(self, folder: Path) -> None:
        said = self.refused(study(evaluations=17), folder)
        assert "study.optimizer.evaluations: was 16, is 17" in said
        assert "restore these inputs" in said
        assert "--out" in said

    def test_of_the_design(self, folder: Path) -> None:
        heavier = study().model_copy(update={"design": GEAR.changed({"shot.mass_g": 6.0})})
        assert "study.design.shot.mass_g: was 5.0, is 6.0" in self.refused(heavier, folder)

    def test_of_what_is_to_be_settled_is_none(self, folder: Path) -> None:
        """A sentence with a point in it, longer than a file's name may be, is no path of a file."""
        told = "LARGER THAN ONE SONOTRODE: a gap of 0.75 mm. " + "Settle it with its maker. " * 12
        matters = GEAR.model_copy(update={"to_settle": (told,)})
        done = calls(folder)
        run(study().model_copy(update={"design": matters}), folder)
        assert calls(folder) > done
        begun = folder.with_name("with a matter")
        run(study().model_copy(update={"design": matters}), begun)
        done = calls(begun)
        run(study(), begun)  # once it is settled
        assert calls(begun) == done

    def test_of_ranges_alone_is_none(self, folder: Path) -> None:
        done = calls(folder)
        known = study().model_copy(update={"design": GEAR.changed({"ranges": {"v0": [1, 1]}})})
        assert len(run(known, folder).trials) == len(run(study(), folder).trials)
        assert calls(folder) > done

    def test_of_the_bounds(self, folder: Path) -> None:
        bounds = {**study().vary, "shot.mass_g": Varied(low=2.0, high=9.0)}
        said = self.refused(study().model_copy(update={"vary": bounds}), folder)
        assert "study.vary.shot.mass_g: was [2.0, 10.0], is [2.0, 9.0]" in said

    def test_of_the_program(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("chamberopt.common.versions.sources_digest", lambda: "another")
        assert 'program.sources: was "' in self.refused(study(), folder)
        monkeypatch.setattr("chamberopt.common.versions.version", lambda _: "99")
        assert 'is "99"' in self.refused(study(), folder)

    def test_of_the_part(self, folder: Path, tmp_path: Path) -> None:
        mesh = tmp_path / "elsewhere" / "gear.stl"
        mesh.parent.mkdir()
        shutil.copy(GEAR.part.mesh_path, mesh)
        moved = GEAR.model_copy(update={"part": GEAR.part.model_copy(update={"mesh": str(mesh)})})
        mesh.write_bytes(mesh.read_bytes()[:-1] + b"\1")
        said = self.refused(study().model_copy(update={"design": moved}), folder)
        assert "study.design.part.mesh.sha256: was" in said
        assert "optimizer" not in said
        # The same file elsewhere is the same part.
        shutil.copy(GEAR.part.mesh_path, mesh)
        run(study().model_copy(update={"design": moved}), folder)
        assert history(folder) == history(tmp_path / "whole")

    @pytest.mark.parametrize("gone", [True, False])
    def test_of_the_part_while_it_runs(self, gone: bool, tmp_path: Path) -> None:
        """A file that is rewritten or removed spoils no row.

        It is recorded neither as another part nor as a candidate that failed.
        """
        mesh = tmp_path / "gear.stl"
        shutil.copy(GEAR.part.mesh_path, mesh)
        part = GEAR.part.model_copy(update={"mesh": str(mesh)})
        question = study().model_copy(update={"design": GEAR.model_copy(update={"part": part})})
        good = logged(tmp_path / "log")

        def simulator(design: Design, stream: str, replicas: int | None) -> Evaluation:
            evaluation = good(design, stream, replicas)
            if len((tmp_path / "log").read_text().splitlines()) == 4:
                mesh.unlink()
                if gone:
                    raise InputError("part.mesh: no such file")
                mesh.write_text("another")
            return evaluation

        with pytest.raises(
            InputError, match=r"while the study ran.*\n  part\.mesh\.(file|sha256): was"
        ):
            run(question, tmp_path / "out", simulator=simulator)
        assert history_rows(tmp_path / "out") == 3
        shutil.copy(GEAR.part.mesh_path, mesh)
        run(question, tmp_path / "out")
        run(study(), tmp_path / "whole")
        assert history(tmp_path / "out") == history(tmp_path / "whole")

    def test_before_anything_was_evaluated_are_free(self, tmp_path: Path) -> None:
        def fails(*_: object) -> Evaluation:
            raise InputError("shot.mass_g: too much")

        with pytest.raises(InputError, match="too much"):
            run(study(), tmp_path / "out", simulator=fails)
        run(study(evaluations=5), tmp_path / "out")
        assert "evaluations = 5" in (tmp_path / "out" / "study.toml").read_text()


class TestEffectsLeftToUs:
    AUTO = GEAR.model_copy(update={"effects": GEAR.effects.model_copy(update={"auto": True})})
    CHOSEN = GEAR.model_copy(
        update={"effects": GEAR.effects.model_copy(update={"auto": False, "gravity": False})}
    )
    CHANGES: ClassVar = {"µ": Estimate(0.1, np.inf, (0.1 + 0.2, 1 / 3))}
    ADVICE: ClassVar = [Advice("gravity", True, "g H / V² = 0.01", CHANGES, 0.01)]

    def test_are_chosen_once(self, tmp_path: Path) -> None:
        """A pilot takes its time: what it said is kept, and the study goes on with it."""
        question = study().model_copy(update={"design": self.AUTO})
        asked: list[Design] = []

        def settle(design: Design) -> tuple[Design, list[Advice]]:
            asked.append(design)
            return self.CHOSEN, self.ADVICE

        for _ in range(2):
            with open_study_folder(question, tmp_path / "out") as record:
                assert record.with_effects_resolved(settle) == (
                    question.model_copy(update={"design": self.CHOSEN}),
                    self.ADVICE,
                )
        assert asked == [self.AUTO]

    @pytest.mark.parametrize(
        ("written", "instead"),
        [
            ('"on": true', '"on": 7'),
            ('"value": 0.1', '"value": "much"'),
            ('"gravity": false', '"gravity": 3'),
            ('"changes"', '"change"'),
            ('"advice": [', '"advice": [[], '),
            ('"effects"', '"effect"'),
        ],
    )
    def test_are_not_taken_from_a_damaged_file(
        self, tmp_path: Path, written: str, instead: str
    ) -> None:
        question = study().model_copy(update={"design": self.AUTO})
        with open_study_folder(question, tmp_path / "out") as record:
            record.with_effects_resolved(lambda _: (self.CHOSEN, self.ADVICE))
        path = tmp_path / "out" / "effects.json"
        text = path.read_text()
        assert written in text
        path.write_text(text.replace(written, instead, 1))
        with (
            open_study_folder(question, tmp_path / "out") as record,
            pytest.raises(InputError, match=r"effects\.json: damaged .*; restore the file"),
        ):
            record.with_effects_resolved(lambda _: (self.CHOSEN, self.ADVICE))


class TestTwoProcesses:
    def test_the_second_is_refused(self, tmp_path: Path) -> None:
        with (
            open_study_folder(study(), tmp_path / "out") as record,
            pytest.raises(
                InputError, match=r"is being written by process \d+ on .* since 2.*wait.*--out"
            ),
            open_study_folder(study(), tmp_path / "out"),
        ):
            pass
        with open_study_folder(study(), tmp_path / "out") as record:
            assert isinstance(record, StudyFolder)

    @pytest.mark.skipif(fork is None, reason="needs fork")
    def test_a_killed_one_holds_nothing(self, tmp_path: Path) -> None:
        held = fork.Event()

        def hold() -> None:
            with open_study_folder(study(), tmp_path / "out"):
                held.set()
                time.sleep(60)

        child = fork.Process(target=hold)
        child.start()
        assert held.wait(20)
        with (
            pytest.raises(InputError, match=f"process {child.pid}"),
            open_study_folder(study(), tmp_path / "out"),
        ):
            pass
        child.kill()
        child.join()
        with open_study_folder(study(), tmp_path / "out"):
            pass


@pytest.mark.long
def test_the_real_thing_killed_from_a_shell(tmp_path: Path) -> None:
    """`chamberopt run` with real simulations ends like an undisturbed run.

    Its history and its answer are the same.
    """
    text = (
        (DESIGNS / "plate.toml")
        .read_text(encoding="utf-8")
        .replace("parts/", f"{(DESIGNS / 'parts').as_posix()}/")
    )
    text = text.replace("replicas = 8", "replicas = 3").replace(
        "simulated_time_s = 4.0", "simulated_time_s = 0.3"
    )
    (tmp_path / "plate.toml").write_text(text, encoding="utf-8")
    (tmp_path / "small.toml").write_text(
        'design = "plate.toml"\n[vary]\n"shot.mass_g" = [1.5, 8.0]\n'
        "[optimizer]\nevaluations = 8\nconfirm = 1\nconfirm_replicas = 3\n"
    )

    def start(out: str) -> subprocess.Popen[bytes]:
        command = [
            sys.executable,
            "-m",
            "chamberopt",
            "run",
            "small.toml",
            "--no-ranges",
            "--out",
            out,
        ]
        return subprocess.Popen(
            command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    assert start("whole").wait() == 0
    out = tmp_path / "out"
    for rows in (1, 4, 7, 9):
        going = start("out")
        while going.poll() is None and not (out.exists() and history_rows(out) >= rows):
            time.sleep(0.02)
        time.sleep(0.1)
        going.kill()
        assert going.wait() != 0
    assert start("out").wait() == 0
    assert history(out) == history(tmp_path / "whole")
    ended, undisturbed = (load_result(folder) for folder in (out, tmp_path / "whole"))
    assert (ended.design, ended.objective, ended.metrics) == (
        undisturbed.design,
        undisturbed.objective,
        undisturbed.metrics,
    )
    for name in ("gain", "best", "confirmed", "start"):
        assert getattr(ended.study, name) == getattr(undisturbed.study, name)
    assert (out / "coverage.vtp").read_bytes() == (tmp_path / "whole" / "coverage.vtp").read_bytes()


def history_rows(folder: Path) -> int:
    return history(folder).count(b"\n") if (folder / "history.jsonl").exists() else 0
