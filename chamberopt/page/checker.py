"""Check designs in a process of its own, so that the page answers meanwhile; the newest counts."""

from __future__ import annotations

import multiprocessing
import os
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock
from typing import Any

from chamberopt.common.errors import InputError
from chamberopt.common.lifetime import end_with_parent

STEP = 0.05  # s between looks at whether an answer is still wanted
ENDED = "the check's process ended (killed from outside, or out of memory)"


class SupersededError(Exception):
    """A newer question was asked."""


class Checker:
    """Answers of `check_answers` for one file: the cavity, and then what is reached.

    A question that comes while an older one is about what is reached ends that process; another
    one, which has read the part already, takes its place.
    """

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._text, self._newest = path, text, 0
        self._turn, self._reaching = Lock(), Lock()
        self._now, self._spare = _Process(path, text), _Process(path, text)

    def cavity(self, text: str) -> tuple[int, bytes]:
        """Number of this question, and the cavity of the design with this text.

        Raises:
            InputError: the design cannot be built.
            SupersededError: a newer question was asked meanwhile.
        """
        self._newest += 1
        mine = self._newest
        with self._turn:
            self._require_newest(mine)
            while self._now.is_busy or not self._now.is_alive:
                self._now.stop()
                self._now, self._spare = self._spare, _Process(self._path, self._text)
            self._now.ask(mine, text)
            return mine, self._answer(self._now, mine)

    def reach(self, number: int) -> bytes:
        """What is reached in the cavity of a question; raises as `cavity` does."""
        with self._reaching:
            process = self._now
            if process.number != number or not process.is_busy:
                raise SupersededError
            while not process.has_answer(STEP):
                self._require_newest(number)
            answer = self._answer(process, number)
            process.is_busy = False
            return answer

    def stop(self) -> None:
        """End the processes."""
        for process in (self._now, self._spare):
            process.stop()

    def _answer(self, process: _Process, number: int) -> bytes:
        try:
            answer = process.answer()
        except (EOFError, OSError):
            if number != self._newest:
                raise SupersededError from None
            self._now, self._spare = self._spare, _Process(self._path, self._text)
            raise InputError(ENDED) from None
        if isinstance(answer, str):
            process.is_busy = False
            raise InputError(answer)
        return answer

    def _require_newest(self, number: int) -> None:
        if number != self._newest:
            raise SupersededError


class _Process:
    """One process that answers questions."""

    def __init__(self, path: Path, text: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(path, text, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self.is_busy, self.number = False, 0

    @property
    def is_alive(self) -> bool:
        return self._process.is_alive()

    def ask(self, number: int, text: str) -> None:
        self.is_busy, self.number = True, number
        with suppress(OSError):  # it has ended, as `answer` tells
            self._pipe.send(text)

    def has_answer(self, seconds: float) -> bool:
        try:
            return self._pipe.poll(seconds)
        except OSError:
            return True  # it has ended, as `answer` tells

    def answer(self) -> Any:
        return self._pipe.recv()

    def stop(self) -> None:
        self._process.kill()


def _serve(path: Path, text: str, pipe: Connection) -> None:
    """Answer each design, as a text, with two packed answers, or with a message why not.

    Before that, read the part of a first one ahead.
    """
    import tomllib
    from signal import SIG_IGN, SIGINT, signal

    from chamberopt.design.design import Design, validate
    from chamberopt.page.answers import check_answers, part_answer
    from sim_core import SceneError

    signal(SIGINT, SIG_IGN)  # Ctrl-C ends the server, which ends this
    end_with_parent()
    if hasattr(os, "nice"):
        os.nice(10)  # the page's own answers come first
    with suppress(InputError, SceneError):
        part_answer(validate(Design, tomllib.loads(text), path, text))
    while True:
        try:
            text = pipe.recv()
        except EOFError:
            return
        try:
            design = validate(Design, tomllib.loads(text), path, text)
            for answer in check_answers(design):
                pipe.send(answer)
        except (InputError, SceneError) as error:
            pipe.send(str(error))
        except Exception as error:  # a fault of ours, which must not be taken for another
            pipe.send(f"the check failed: {error!r}")
