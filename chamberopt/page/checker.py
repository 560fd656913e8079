"""Check designs in child processes, so that the page's server answers meanwhile.

A newer question ends the check of an older question.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Lock

from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from chamberopt.page.answers import check_answers, part_answer
from sim_core import SceneError

ENDED = "the check's process ended (killed from outside, or out of memory)"


class SupersededError(Exception):
    """The answer to a question is no longer wanted, because a newer question was asked."""


class Checker:
    """Answers questions on versions of a design: first its cavity, then the reach of its shot.

    A new question ends the child process that still computes the reach for an older question. A
    spare child, which has read the part already, takes its place.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._text, self._newest = path, text, 0
        self._turn, self._reaching = Lock(), Lock()
        self._now, self._spare = self._start(), self._start()
        self._asked: dict[Child, int] = {}  # number of the question that a child works at

    def cavity(self, text: str, step: int = 0) -> tuple[int, bytes]:
        """Return the number of this question, and the cavity of the design with this text.

        Args:
            step: number of the step whose chamber is shown, for a design with steps.

        Raises:
            InputError, SceneError: the design cannot be built.
            SupersededError: a newer question was asked meanwhile.
        """
        self._newest += 1
        mine = self._newest
        with self._turn:
            if mine != self._newest:
                raise SupersededError
            while self._now in self._asked or self._now.pid is None:
                self._replace()
            self._asked[self._now] = mine
            self._now.ask(_check, self._path, text, step)
            return mine, self._answer(self._now, mine)

    def reach(self, number: int) -> bytes:
        """Return which surface the shot can reach, for the design of the question with this number.

        Raises:
            InputError, SceneError: the reach cannot be computed.
            SupersededError: a newer question was asked meanwhile.
        """
        with self._reaching:
            child = self._now
            if self._asked.get(child) != number:
                raise SupersededError
            answer = self._answer(child, number)
            self._asked.pop(child, None)
            return answer

    def stop(self) -> None:
        """End the child processes."""
        for child in (self._now, self._spare):
            child.end()

    def _start(self) -> Child:
        child = Child()
        child.ask(_read_ahead, self._path, self._text)
        return child

    def _replace(self) -> None:
        self._now.end()
        self._asked.pop(self._now, None)
        self._now, self._spare = self._spare, self._start()

    def _answer(self, child: Child, number: int) -> bytes:
        try:
            return bytes(child.answer())
        except ChildLostError:
            if number != self._newest:
                raise SupersededError from None
            self._replace()
            raise InputError(ENDED) from None
        except Exception:
            self._asked.pop(child, None)
            raise


def _read_ahead(path: Path, text: str) -> Iterator[bytes]:
    """Read the part of a design, which this child process keeps for later checks.

    Yields no answer.
    """
    if hasattr(os, "nice"):
        os.nice(10)  # the page's own answers come first
    with suppress(Exception):  # the first check meets the same fault, and tells it
        part_answer(validate(Design, tomllib.loads(text), path, text))
    yield from ()


def _check(path: Path, text: str, step: int) -> Iterator[bytes]:
    """Yield the cavity of the design with this text, then the reach of its shot.

    Raises InputError or SceneError if the design cannot be built.
    """
    try:
        yield from check_answers(validate(Design, tomllib.loads(text), path, text), step)
    except (InputError, SceneError):
        raise
    except Exception as error:  # a fault of the program, whose message must not blame the design
        raise InputError(f"the check failed: {error!r}") from None
