"""The evaluation of a candidate, and its file.

The file is an .npz of all arrays, with one more entry, `tree`: JSON of everything else. In it
{"array": name} stands for an array and {"is": class, "of": fields} for a dataclass. Sequences come
back as tuples. A study keeps its confirmed candidates in such files, exactly, so that it can be
resumed without simulating them again.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.files import UNREADABLE_NPZ, atomic_write
from chamberopt.coverage.coverage_intervals import Resolution
from chamberopt.coverage.part_impacts import Hits


@dataclass(frozen=True)
class Evaluation:
    """One candidate, simulated in independent replicas."""

    objective_name: str
    objective: Estimate  # the weighted sum of metrics that a study maximises
    metrics: dict[str, Estimate]  # estimate of each metric at the gauge, by its name
    metrics_of_wide: dict[str, Estimate]  # those of coverage in windows of twice the radius
    resolution: Resolution
    reachable: float  # share of the target that a ball can touch
    crease_share: float  # share of the dented area that is on creases
    replicas: int
    simulated_time: float  # recorded time of all replicas together [s]
    hits: tuple[Hits, ...]  # single impacts of each replica on the part
    timings: dict[str, float]  # wall-clock time of each step [s]
    collisions: dict[str, int]  # number of simulated collisions of each kind, warm-up included
    notes: tuple[str, ...] = ()  # what to know before trusting the result
    stream: str = "search"  # stream of seeds, "search" or "confirm"
    # What ended it: "replicas" (their number was given), "accuracy" or "max_replicas".
    stopped_by: str = "replicas"
    analytic: bool = False  # whether it ran in an exact cavity instead of the chamber's mesh


CLASSES = {kind.__name__: kind for kind in (Evaluation, Estimate, Hits, Resolution)}


def save_evaluation(path: Path, evaluation: Evaluation) -> None:
    """Write an evaluation to its file. Raises OSError if it cannot be written."""
    arrays: dict[str, np.ndarray] = {}
    tree = json.dumps(_to_tree(evaluation, arrays)).encode()
    packed = io.BytesIO()  # in memory first, so that a full disk is one plain OSError
    np.savez_compressed(packed, tree=np.frombuffer(tree, dtype=np.uint8), **arrays)  # type: ignore[arg-type]
    with atomic_write(path) as temporary:
        temporary.write_bytes(packed.getbuffer())


def load_evaluation(path: Path) -> Evaluation:
    """Read an evaluation, equal to the one that was saved.

    Raises:
        InputError: the file is missing or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        evaluation = _from_tree(json.loads(arrays.pop("tree").tobytes()), arrays)
        if not isinstance(evaluation, Evaluation):
            raise TypeError("another kind of file")
    except UNREADABLE_NPZ as error:
        why = getattr(error, "strerror", None) or f"damaged ({error})"
        raise InputError(
            f"{path}: {why}; restore the file or run the study in a new folder"
        ) from None
    return evaluation


def _to_tree(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Plain JSON values; arrays go into `arrays` under new names."""
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


def _from_tree(tree: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(tree, list):
        return tuple(_from_tree(one, arrays) for one in tree)
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    parts = {name: _from_tree(one, arrays) for name, one in tree["of"].items()}
    return parts if tree["is"] == "dict" else CLASSES[tree["is"]](**parts)
