"""Check that data from files are not too large, before memory is taken for them."""

from __future__ import annotations

import json
import math
import os
import sys
from contextlib import suppress
from pathlib import Path

from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.files import open_plain
from chamberopt.common.number_text import plain

MEBIBYTE = 1 << 20
MAX_TEXT_BYTES = MEBIBYTE  # a design, a study, or a user's own shape
MAX_RESULT_BYTES = 256 * MEBIBYTE  # a result.json
MAX_MESH_BYTES = 2048 * MEBIBYTE
MAX_UNPACKED_BYTES = 1024 * MEBIBYTE  # size of an unpacked compressed mesh
MAX_READER_BYTES = 16384 * MEBIBYTE  # memory of a library that reads STEP or VTK
# A result's compressed arrays unpack to some three times their size. A larger factor fills memory
# on purpose.
MAX_SHRINKAGE, ANY_SHRINKAGE_BYTES = 100, 64 * MEBIBYTE
MAX_CPU_S = 1e7  # four months, for a library that reads STEP or VTK
MAX_NUMBER = 1e30  # largest size of any number in a result: its squares and cubes are finite
MAX_ELEMENTS = 20_000_000  # points, elements or triangles of a mesh
MAX_COPIES = 10_000  # copies of bodies that a file puts in several places


def read_limited(path: Path, most: int, what: str, follow: bool = False) -> bytes:
    """Return the content of a file that is not too large.

    Args:
        most: largest number of bytes.
        what: kind of the file in messages, such as "mesh file".
        follow: True to follow links, which users may have among their own files.
    Raises:
        FileNotFoundError: if it is missing, which the caller must explain.
        InputError: if it is no plain file, such as a link or a pipe, or is too large.
        UnreadableError: if the operating system cannot read it.
    """
    try:
        with open_plain(path, follow) as file:
            require_size(path, os.fstat(file.fileno()).st_size, most, what)
            # A file of /proc states no size, and its end may never come. The read does not wait for
            # it.
            content = file.read(most + 1)
        if content is None:
            raise InputError(f"{path}: is not a plain file; give a {what}")
    except FileNotFoundError:
        raise
    except OSError as error:
        why = f"cannot be read: {error.strerror}"
        raise UnreadableError(f"{path}: {why}; check the path and its permissions") from None
    except ValueError:  # a null character in the name
        raise InputError(f"{str(path)!r}: not a file name; check the path") from None
    require_size(path, len(content), most, what)
    return content


def limit_memory() -> None:
    """Limit the memory of this process to MAX_READER_BYTES, if the operating system can do so."""
    if sys.platform == "win32":
        return
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = MAX_READER_BYTES if hard == resource.RLIM_INFINITY else min(MAX_READER_BYTES, hard)
    with suppress(ValueError, OSError):  # macOS refuses a limit below what it has mapped
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))


def limit_cpu_time(seconds: float) -> None:
    """Let the system end this process after `seconds` of CPU time, without a core dump.

    Systems without such a limit (Windows) do nothing.
    """
    if sys.platform == "win32":
        return
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    most = math.ceil(min(seconds, MAX_CPU_S))
    resource.setrlimit(resource.RLIMIT_CPU, (min(most, hard) if hard >= 0 else most, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def raise_cpu_time(seconds: float) -> None:
    """Add `seconds` to the CPU time that this process may use, if its CPU time is limited."""
    if sys.platform == "win32":
        return
    import resource

    soft, _ = resource.getrlimit(resource.RLIMIT_CPU)
    if soft != resource.RLIM_INFINITY:
        limit_cpu_time(soft + seconds)


def require_size(path: Path, size: int, most: int, what: str) -> None:
    """Raise InputError if a file has more than `most` bytes.

    Args:
        size: bytes of the file.
        what: kind of the file in the message, such as "mesh file".
    """
    if size > most:
        given = f"a {what} of {size / MEBIBYTE:,.1f} MiB"
        raise InputError(f"{path}: {given}, at most {most / MEBIBYTE:,g} MiB are read; reduce it")


def require_few(path: Path, count: int, what: str, most: int = MAX_ELEMENTS) -> None:
    """Raise InputError if a mesh file has more than `most` items.

    Args:
        count: number of items in the file.
        what: kind of the items in the message, such as "triangles".
    """
    if count > most:
        text = f"{plain(count)} {what}, at most {most:,} are read; export a coarser mesh"
        raise InputError(f"{path}: {text}")


def parse_json(content: bytes | str) -> object:
    """Return the value of a JSON text from a result folder.

    Raises ValueError for a text that is not JSON, and for numbers that Python would read although
    nothing can be computed with them: NaN, and sizes above MAX_NUMBER, such as 1e999.
    """
    value = json.loads(
        content, parse_constant=_plain_number, parse_float=_plain_number, parse_int=_whole_number
    )
    require_text(content, value)
    return value


def require_text(content: bytes | str, value: object) -> None:
    """Raise ValueError if a text in a JSON value has half a character, which no file can hold.

    Such halves are escapes, for example \\ud800 without its second half.

    Args:
        content: the JSON text.
        value: the value that was read from it.
    """
    if ("\\ud" if isinstance(content, str) else b"\\ud") in content.lower():  # type: ignore[operator]
        json.dumps(value, ensure_ascii=False).encode()  # UnicodeEncodeError is a ValueError


def _plain_number(text: str) -> float:
    if not abs(number := float(text)) <= MAX_NUMBER:
        raise ValueError(f"{text[:20]} is not a number up to {MAX_NUMBER:g}")
    return number


def _whole_number(text: str) -> int:
    if len(text) > 20 or not -(2**63) <= int(text) < 2**63:
        raise ValueError(f"{text[:20]} has more digits than a whole number that is read")
    return int(text)
