"""An evaluation as one file, whole and exact: what a study needs of a confirmed candidate to go on without it.

A .npz of its arrays, with one more entry, `tree`: JSON of all the rest, in which {"array": name} stands for an array
and {"is": class, ...} for a dataclass. Sequences come back as tuples.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.coverage.hits import Hits
from chamberopt.coverage.statistics.interval import Estimate
from chamberopt.coverage.tally import Tally
from chamberopt.simulation.evaluate import Evaluation

CLASSES = {kind.__name__: kind for kind in (Evaluation, Estimate, Hits, Tally)}


def save_evaluation(path: Path, evaluation: Evaluation) -> None:
    """Write it, whole or not at all. Raises OSError where it cannot be written."""
    arrays: dict[str, np.ndarray] = {}
    tree = json.dumps(_taken_apart(evaluation, arrays))
    packed = io.BytesIO()  # in memory first: a full disk is then one plain OSError
    np.savez_compressed(packed, tree=np.frombuffer(tree.encode(), dtype=np.uint8), **arrays)  # type: ignore[arg-type]
    with atomic_write(path) as temporary:
        temporary.write_bytes(packed.getbuffer())


def load_evaluation(path: Path) -> Evaluation:
    """The evaluation in a file, equal to the one saved. Raises InputError for a file gone or damaged."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        evaluation = _put_together(json.loads(arrays.pop("tree").tobytes()), arrays)
        if not isinstance(evaluation, Evaluation):
            raise TypeError("another kind of file")
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        why = getattr(error, "strerror", None) or f"damaged ({error})"
        raise InputError(
            f"{path}: {why}; restore the file or run the study in a new folder"
        ) from None
    return evaluation


def _taken_apart(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Plain JSON values; arrays go into `arrays` under a name of their own."""
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if is_dataclass(value):
        parts = {
            column.name: _taken_apart(getattr(value, column.name), arrays)
            for column in fields(value)
        }
        return {"is": type(value).__name__, "of": parts}
    if isinstance(value, dict):
        return {
            "is": "dict",
            "of": {name: _taken_apart(item, arrays) for name, item in value.items()},
        }
    if isinstance(value, (tuple, list)):
        return [_taken_apart(item, arrays) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _put_together(tree: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(tree, list):
        return tuple(_put_together(item, arrays) for item in tree)
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    parts = {name: _put_together(item, arrays) for name, item in tree["of"].items()}
    return parts if tree["is"] == "dict" else CLASSES[tree["is"]](**parts)
