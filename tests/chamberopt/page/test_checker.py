"""A question is answered, superseded by a newer one, or told that its child was killed."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from chamberopt.chamber.part import preview_part
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design
from chamberopt.page.checker import Checker, SupersededError
from tests.hunt.base import write_base

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs signals")


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("checker")
    write_base(folder)
    return folder / "design.toml", (folder / "design.toml").read_text()


@pytest.fixture
def checker(text: tuple[Path, str]) -> Iterator[Checker]:
    started = Checker(text[0])
    yield started
    started.stop()


def begun(checker: Checker, act: Callable[..., Any], *asked: Any) -> Future[Any]:
    """Ask in a thread, with the child that works held still."""
    assert checker._now.pid is not None
    os.kill(checker._now.pid, signal.SIGSTOP)
    threads = ThreadPoolExecutor(1)
    answer = threads.submit(act, *asked)
    threads.shutdown(wait=False)
    time.sleep(0.5)
    assert not answer.done()
    return answer


def test_two_answers_on_one_design_come_from_one_child(
    checker: Checker, text: tuple[Path, str]
) -> None:
    child = checker._now
    for _ in range(2):
        number, cavity = checker.cavity(text[1])
        assert b'"facts"' in cavity
        assert b'"facts"' in checker.reach(number)
        assert checker._now is child
        with pytest.raises(SupersededError):
            checker.reach(number)


def test_a_wrong_design_is_told_and_the_next_is_answered(
    checker: Checker, text: tuple[Path, str]
) -> None:
    child = checker._now
    with pytest.raises(InputError, match="mass_g"):
        checker.cavity(text[1].replace("mass_g = 3", "mass_g = -3"))
    with pytest.raises(InputError, match=r"^the check failed: TOMLDecodeError"):
        checker.cavity("[")
    assert checker.cavity(text[1])[0] == 3
    assert checker._now is child


def test_a_newer_question_ends_the_child_that_works_at_what_is_reached(
    checker: Checker, text: tuple[Path, str]
) -> None:
    number = checker.cavity(text[1])[0]
    child = checker._now
    checker._now.answer()  # what is reached: it may have come before the child is held
    reach = begun(checker, checker.reach, number)
    newer = checker.cavity(text[1])[0]
    with pytest.raises(SupersededError):
        reach.result(20)
    assert child.pid is None
    assert b'"facts"' in checker.reach(newer)


def test_a_child_that_is_killed_is_told_and_replaced(
    checker: Checker, text: tuple[Path, str]
) -> None:
    child = checker._now
    cavity = begun(checker, checker.cavity, text[1])
    assert child.pid is not None
    os.kill(child.pid, signal.SIGKILL)
    with pytest.raises(InputError, match="process ended"):
        cavity.result(20)
    checker._now.end()  # the spare that took its place, while it waits
    assert b'"facts"' in checker.cavity(text[1])[1]


def test_a_part_that_the_server_has_read_is_not_read_again(
    checker: Checker, text: tuple[Path, str]
) -> None:
    """The note of the part that was given is not one that the file would give."""
    design = load_design(text[0])
    part = replace(preview_part(design).mesh, notes=("read by the server",))
    for _ in range(2):
        number, cavity = checker.cavity(text[1], part=part)
        assert b"read by the server" in cavity
        assert b"read by the server" in checker.reach(number)
    assert checker._spare is not None
