"""What can be compared: the same surface, peened for the same time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.design.design import Design


def require_several(paths: Sequence[Path]) -> None:
    """InputError for fewer than two, or the same one twice."""
    if len(paths) < 2:
        raise InputError(
            f"compare: {len(paths)} candidate given; give two or more designs (.toml) or results folders"
        )
    seen: dict[Path, Path] = {}
    for path in paths:
        place = path.resolve()
        if place in seen:
            raise InputError(
                f"{path}: given twice (as {seen[place]}); it does not differ from itself: leave one out"
            )
        seen[place] = path


def require_one_time(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """InputError for treatment times that differ."""
    first = designs[0].process.treatment_time_s
    for path, design in zip(paths, designs, strict=True):
        seconds = design.process.treatment_time_s
        if seconds != first:
            raise InputError(
                f"{path}: peened for {seconds:g} s, {paths[0]} for {first:g} s: coverage after different times cannot "
                "be compared; give --treatment-time-s S, and what is not of S seconds is simulated again for it"
            )


def require_same_part(
    paths: Sequence[Path], designs: Sequence[Design], meshes: Sequence[tuple[str, str]]
) -> None:
    """InputError for other parts, units or targets than the first's; a part may stand otherwise in its chamber.

    meshes: sha256 of each part's file, and the unit that its numbers were taken in.
    """
    for path, design, mesh in zip(paths[1:], designs[1:], meshes[1:], strict=True):
        if mesh[0] != meshes[0][0]:
            raise InputError(
                f"{path}: another part ({design.part.mesh_path.name}) than in {paths[0]} "
                f"({designs[0].part.mesh_path.name}); only candidates for the same part mesh can be compared"
            )
        pairs = {
            "unit": (meshes[0][1], mesh[1]),
            "target": (designs[0].part.target, design.part.target),
        }
        for name, (mine, theirs) in pairs.items():
            if mine != theirs:
                raise InputError(
                    f"{path}: part.{name} differs from {paths[0]} ({theirs} and {mine}): the figures "
                    "would be of different surfaces; simulate both with the same"
                )


def require_same_triangles(path: Path, target: np.ndarray, first: Path, wanted: np.ndarray) -> None:
    """InputError where two targets (m,) bool, chosen by the same rule, are not the same triangles.

    As with part.target.reachable, of which each chamber makes its own.
    """
    if len(target) != len(wanted) or (target != wanted).any():
        raise InputError(
            f"{path}: its target is {target.sum()} triangles, not the same as the {wanted.sum()} of {first} "
            "(part.target.reachable goes by the chamber); give its design in place of the result: it is simulated on "
            "the first's target"
        )
