"""Writing without regret: a folder that was not in use, and files that appear whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chamberopt.errors import InputError


def new_folder(path: str | Path) -> Path:
    """The folder, made if need be; InputError when something is in it: results are never overwritten."""
    folder = Path(path)
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise InputError(f"{folder}: is a file; results need a folder: choose another folder (out, or --out)")
    try:
        if folder.is_dir() and any(folder.iterdir()):
            raise InputError(
                f"{folder}: already holds files, and results are never overwritten: choose "
                "another folder (out, or --out) or remove this one (resuming a study is not supported yet)"
            )
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):  # better now than after an hour's work
            pass
    except OSError as error:
        why = f"{folder}: cannot be written: {error.strerror}; choose another folder (out, or --out)"
        raise InputError(why) from None
    return folder


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`, with the same suffix, that takes its place when the block ends well."""
    temporary = path.with_name(f".writing-{path.name}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
