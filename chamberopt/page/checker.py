"""Check designs in child processes, so that the page's server answers meanwhile.

A newer question ends the check of an older question.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from threading import Lock

from chamberopt.chamber.part import keep_part_of
from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.page.answers import check_answers
from sim_core import SceneError

# Of a check: enough that the page comes first, and so little that a simulation does not starve it.
NICE = 3
ENDED = "the check's process ended (killed from outside, or out of memory)"


class SupersededError(Exception):
    """The answer to a question is no longer wanted, because a newer question was asked."""


class Checker:
    """Answers questions on versions of a design: first its cavity, then the reach of its shot.

    A new question ends the child process that still computes the reach for an older question. A
    spare child, which is started after an answer, takes its place.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._newest = path, 0
        self._turn, self._reaching = Lock(), Lock()
        self._now: Child = _started()
        self._spare: Child | None = None
        self._asked: dict[Child, int] = {}  # number of the question that a child works at
        self._has: dict[Child, PartMesh] = {}  # part that a child was given

    def cavity(self, text: str, step: int = 0, part: PartMesh | None = None) -> tuple[int, bytes]:
        """Return the number of this question, and the cavity of the design with this text.

        Args:
            step: number of the step whose chamber is shown, for a design with steps.
            part: the design's part as its file has it; None if the child is to read it.

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
            new = None if self._has.get(self._now) is part else part
            if new is not None:
                self._has[self._now] = new
            self._now.ask(_check, self._path, text, step, new)
            answer = self._answer(self._now, mine)
            self._spare = self._spare or _started()
            return mine, answer

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
        for child in filter(None, (self._now, self._spare)):
            child.end()

    def _replace(self) -> None:
        self._now.end()
        self._asked.pop(self._now, None)
        self._has.pop(self._now, None)
        self._now, self._spare = self._spare or _started(), None

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


def _started() -> Child:
    """Return a child process that has imported what a check takes."""
    child = Child()
    child.ask(_yield_to_the_page)
    return child


def _yield_to_the_page() -> Iterator[bytes]:
    """Let the page's own answers come first. Yields no answer."""
    if hasattr(os, "nice"):
        os.nice(NICE)
    yield from ()


def _check(path: Path, text: str, step: int, part: PartMesh | None) -> Iterator[bytes]:
    """Yield the cavity of the design with this text, then the reach of its shot.

    Args:
        part: the part of the design, if this process has not got it yet.

    Raises InputError or SceneError if the design cannot be built.
    """
    try:
        design = validate(Design, tomllib.loads(text), path, text)
        if part is not None:
            keep_part_of(design, part)
        yield from check_answers(design, step)
    except (InputError, SceneError):
        raise
    except Exception as error:  # a fault of the program, whose message must not blame the design
        raise InputError(f"the check failed: {error!r}") from None
