"""An evaluation as one file, whole and exact: what a study needs of a confirmed candidate to go on without it.

A .npz of its arrays, with one more entry, `tree`: JSON of all the rest, in which {"array": name} stands for an array
and {"is": class, ...} for a dataclass. Sequences come back as tuples.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from dataclasses import dataclass, fields, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.part_impacts import Hits, HitsByTriangle, sort_hits_by_triangle
from chamberopt.coverage.statistics.confidence_interval import Estimate


@dataclass(frozen=True)
class Evaluation:
    """One candidate, simulated: its objective and metrics with intervals, and the tallies they come from.

    total: sum of the replicas' tallies · replicas: one Tally each · timings: seconds of wall clock by step ·
    collisions: numbers of simulated collisions by kind, warm-up included · notes: what to know before
    trusting it · stopped_by: what ended it, "replicas" (a number was asked for), "accuracy" or "max_replicas" ·
    analytic: in an exact cavity, not the chamber's mesh ·
    hits: of each replica, its impacts one by one ·
    marked (m,): share of each part triangle inside dents, NaN unexposed, marked_interval (m,): width of its 95 %
    interval, and against_time: (time s, mean coverage of the target) pairs; all only where every dent is marked.
    """

    objective_name: str
    objective: Estimate
    metrics: dict[str, Estimate]
    total: Tally
    replicas: tuple[Tally, ...]
    timings: dict[str, float]
    collisions: dict[str, int]
    notes: tuple[str, ...] = ()
    stream: str = "search"
    stopped_by: str = "replicas"
    analytic: bool = False
    hits: tuple[Hits, ...] = ()
    marked: np.ndarray | None = None
    marked_interval: np.ndarray | None = None
    against_time: tuple[tuple[float, Estimate], ...] = ()

    @cached_property
    def sorted_hits(self) -> HitsByTriangle | None:
        """The hits of all replicas by part triangle; None where there are none to tell of."""
        return sort_hits_by_triangle(self.hits, len(self.total.impacts)) if self.hits else None


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
