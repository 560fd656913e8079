"""Run chamberopt commands, each in a process of its own with limits on memory and time.

A server process imports everything once and forks for each command, so that a command costs
milliseconds and yet can neither end nor change the tests that run it. Start it with `Server()`.
`Executable()` starts what a user starts, which takes a second.
"""

from __future__ import annotations

import faulthandler
import hashlib
import json
import os
import pkgutil
import re
import resource
import signal
import stat
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Self

ROOT = Path(__file__).resolve().parents[2]
MEMORY = 3 << 30  # bytes that a command may take beyond what the server has
FILE_SIZE = 1 << 30  # bytes of the largest file that it may write
SECONDS = 30  # of CPU, and twice that of wall-clock time
WITHOUT_VTK = "tests.chamberopt.common.files.shim:run_drawing"  # a command's pictures are empty
CONTROL = {*map(chr, range(32)), *map(chr, range(127, 160))} - {"\n"}


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    status: int  # exit status; -9 if it was ended by signal 9
    output: str
    errors: str
    seconds: float


class Server:
    """Forks a process for each command; `with Server() as server: server.run(folder, words)`."""

    def __enter__(self) -> Self:
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), environment.get("PYTHONPATH", "")])
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.hunt.command"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def run(
        self,
        folder: Path,
        words: Sequence[str],
        kill_after: float = 0.0,
        seconds: float = SECONDS,
        within: str = "",
    ) -> Outcome:
        """Run `chamberopt WORDS` in a folder.

        Args:
            kill_after: seconds after which the command is interrupted with Ctrl-C, if positive.
            seconds: of CPU time that it may take.
            within: "module:function" of a test, called with the words, runs the command itself.
        """
        request = {"folder": str(folder), "words": list(words), "kill_after": kill_after}
        request |= {"seconds": seconds, "within": within}
        print(json.dumps(request), file=self._process.stdin, flush=True)
        return Outcome(**json.loads(self._process.stdout.readline()))

    def warm_up(self, within: str) -> None:
        """Call a function in the process that the commands are forked from."""
        print(json.dumps({"warm_up": within}), file=self._process.stdin, flush=True)


class Executable:
    """Starts the installed program for each command."""

    def run(self, folder: Path, words: Sequence[str], seconds: float = SECONDS) -> Outcome:
        """Run `chamberopt WORDS` in a folder, as Server.run does."""
        begin = time.monotonic()
        program = Path(sys.executable).with_name("chamberopt")
        with subprocess.Popen(
            [program, *words],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            preexec_fn=lambda: _limit(MEMORY, seconds),
            process_group=0,
        ) as going:
            try:
                texts = going.communicate(timeout=2.0 * seconds)
            except subprocess.TimeoutExpired:
                os.killpg(going.pid, signal.SIGKILL)
                texts = going.communicate()
        return Outcome(going.returncode, *texts, time.monotonic() - begin)


def fault(outcome: Outcome, allowed: Sequence[int] = (0, 2)) -> str | None:
    """What is wrong with the end of a command, or None."""
    text = outcome.output + outcome.errors
    if outcome.status < 0:
        return f"ended by {signal.Signals(-outcome.status).name}"
    if "Traceback" in text or 'File "' in text:
        return "a traceback"
    if re.search(r"\.py:\d+: \w*Warning", text):
        return "a warning of Python"
    if outcome.status not in allowed:
        return f"exit status {outcome.status}"
    if outcome.status and not outcome.errors.strip():
        return "refused without a message"
    if len(outcome.errors) > 20_000 or outcome.errors.count("\n") > 40:
        return "a message that nobody reads to its end"
    if CONTROL.intersection(text):
        return "a control character on the terminal"
    return None


def fingerprint(folder: Path) -> dict[str, str]:
    """Name -> digest or kind of everything in a folder, to see what a command changed."""
    found = {}
    for path in sorted(folder.rglob("*")):
        mode = path.lstat().st_mode
        is_plain = stat.S_ISREG(mode)
        found[str(path.relative_to(folder))] = (
            hashlib.sha256(path.read_bytes()).hexdigest() if is_plain else str(stat.S_IFMT(mode))
        )
    return found


def main() -> None:
    """Serve requests from stdin, one a line, until it is closed."""
    import chamberopt

    for package in (chamberopt,):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                import_module(module.name)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        if function := request.get("warm_up"):
            _function(function)()
        else:
            print(json.dumps(asdict(_run(request))), file=answers, flush=True)


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.partition(":")
    return getattr(import_module(module), function)


def _run(request: dict[str, Any]) -> Outcome:
    files = [os.memfd_create(name) for name in ("output", "errors")]
    begin = time.monotonic()
    child = os.fork()
    if child == 0:
        _be_the_command(request, files)
    status, deadline = None, begin + 2.0 * request["seconds"]
    interrupt_at = begin + request["kill_after"] if request["kill_after"] else float("inf")
    pause = 1e-3
    while status is None:
        ended, code = os.waitpid(child, os.WNOHANG)
        if ended:
            status = os.waitstatus_to_exitcode(code)
        elif time.monotonic() > deadline:
            os.killpg(child, signal.SIGKILL)
        elif time.monotonic() > interrupt_at:
            os.killpg(child, signal.SIGINT)
            interrupt_at = float("inf")
        time.sleep(pause)
        pause = min(1.5 * pause, 0.05)
    texts = []
    for file in files:
        os.lseek(file, 0, os.SEEK_SET)
        with os.fdopen(file, "rb") as stream:
            texts.append(stream.read(1 << 20).decode(errors="replace"))
    return Outcome(status, *texts, time.monotonic() - begin)


def _limit(memory: int, seconds: float) -> None:
    """Limit this process's memory [bytes], the files that it writes, and its CPU time."""
    limit = round(seconds)
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_SIZE, FILE_SIZE))
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))


def _be_the_command(request: dict[str, Any], files: list[int]) -> None:
    """Become `chamberopt WORDS`, within the limits; does not return."""
    status = 70
    try:
        os.setpgid(0, 0)
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        _limit(taken + MEMORY, request["seconds"])
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(files[0], 1)
        os.dup2(files[1], 2)
        faulthandler.disable()
        os.chdir(request["folder"])
        from chamberopt.cli import main as command

        sys.argv[:] = ["chamberopt", *request["words"]]
        sys.stdin = open(0, closefd=False)  # noqa: SIM115
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115
        try:
            within = request["within"]
            status = _function(within)(request["words"]) if within else command()
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(bool(end.code))
        except BaseException:
            traceback.print_exc()
            status = 1
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(status)


if __name__ == "__main__":
    main()
