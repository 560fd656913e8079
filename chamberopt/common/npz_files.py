"""Write and read arrays, and dataclasses that hold arrays (records), in .npz files.

The files hold plain data and never pickles. The file of a record has one more entry, `tree`: JSON
of all content except arrays. In `tree`, {"array": name} stands for an array and {"is": class, "of":
fields} for a dataclass. Sequences are read back as tuples, and all else exactly as it was written.
"""

from __future__ import annotations

import io
import json
import lzma
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import new_file, open_plain, write_bytes
from chamberopt.common.limits import ANY_SHRINKAGE_BYTES, MAX_SHRINKAGE, require_text

# Errors that zipfile, NumPy's parser of headers and our own readers raise for a damaged file.
UNREADABLE = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RuntimeError,
    SyntaxError, TypeError, ValueError, lzma.LZMAError, tokenize.TokenError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
Record = TypeVar("Record")


def read_arrays(path: Path, remedy: str) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz file by their names.

    Raises InputError, which ends with `remedy`, if the file is missing or damaged.
    """
    try:
        with open_plain(path) as file:
            with zipfile.ZipFile(file) as packed:
                unpacked = sum(one.file_size for one in packed.infolist())
            if unpacked > max(ANY_SHRINKAGE_BYTES, MAX_SHRINKAGE * file.seek(0, 2)):
                raise ValueError(f"unpacks to {1e-6 * unpacked:,.0f} MB, which no result does")
            file.seek(0)
            with np.load(file, allow_pickle=False) as arrays:
                return {name: arrays[name] for name in arrays.files}
    except FileNotFoundError:
        raise InputError(f"{path}: not there; {remedy}") from None
    except UNREADABLE as error:
        raise _unreadable(path, error, remedy) from None


def save_arrays(path: Path, **arrays: Any) -> None:
    """Write arrays to an .npz file under the names of their arguments."""
    with new_file(path) as file:
        np.savez(file, **arrays)


def save_record(path: Path, record: object) -> None:
    """Write a dataclass with all its content to an .npz file.

    Raises OSError if the file cannot be written.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = json.dumps(_to_tree(record, arrays)).encode()
    packed = io.BytesIO()  # in memory first, so that a full disk is one plain OSError
    np.savez_compressed(packed, tree=np.frombuffer(tree, dtype=np.uint8), **arrays)  # type: ignore[arg-type]
    write_bytes(path, packed.getbuffer())


def load_record(path: Path, kind: type[Record], others: Sequence[type], remedy: str) -> Record:
    """Return the dataclass that `save_record` wrote to an .npz file.

    Args:
        kind: class of the record.
        others: classes of the objects in the record. No object of another class is made.
        remedy: end of the message on a file that cannot be used.

    Raises:
        InputError: if the file is missing or damaged, or written by another version of the program.
    """
    arrays = read_arrays(path, remedy)
    classes = {one.__name__: one for one in (kind, *others)}
    try:
        text = arrays.pop("tree").tobytes()
        tree = json.loads(text)
        require_text(text, tree)
        record = _from_tree(tree, arrays, classes)
        if not isinstance(record, kind):
            raise TypeError("another kind of file")
    except UNREADABLE as error:
        raise _unreadable(path, error, remedy) from None
    return record


def is_of_type(value: object, hint: object) -> bool:
    """Return True if a value from a file, with all its content, has the types of `hint`.

    A whole number may stand for a float. True and false are no numbers.

    Args:
        hint: a plain class, a dataclass, tuple[T, ...], dict[str, T] or a union of them.
    """
    if is_dataclass(hint):
        parts = get_type_hints(hint).items()
        return type(value) is hint and all(is_of_type(getattr(value, k), one) for k, one in parts)
    kind, inner = get_origin(hint), get_args(hint)
    if kind is UnionType:
        return any(is_of_type(value, one) for one in inner)
    if kind is tuple:
        return type(value) is tuple and all(is_of_type(one, inner[0]) for one in value)
    if kind is dict:
        return type(value) is dict and all(is_of_type(one, inner[1]) for one in value.values())
    return type(value) is hint or (hint is float and type(value) is int)


def _unreadable(path: Path, error: BaseException, remedy: str) -> InputError:
    why = getattr(error, "strerror", None) or f"damaged ({error})"
    return InputError(f"{path}: {why}; {remedy}")


def _to_tree(value: object, arrays: dict[str, np.ndarray]) -> object:
    """Return the value as plain JSON values, and put arrays in it into `arrays` under new names."""
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if is_dataclass(value):
        parts = {one.name: _to_tree(getattr(value, one.name), arrays) for one in fields(value)}
        return {"is": type(value).__name__, "of": parts}
    if isinstance(value, dict):
        return {"is": "dict", "of": {name: _to_tree(one, arrays) for name, one in value.items()}}
    if isinstance(value, (tuple, list)):
        return [_to_tree(one, arrays) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _from_tree(tree: object, arrays: dict[str, np.ndarray], classes: dict[str, type]) -> object:
    if isinstance(tree, list):
        return tuple(_from_tree(one, arrays, classes) for one in tree)
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    parts = {name: _from_tree(one, arrays, classes) for name, one in tree["of"].items()}
    return parts if tree["is"] == "dict" else classes[tree["is"]](**parts)
