"""Checks that candidates can be compared: the same surface, peened for the same time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.design.design import Design


def require_several(paths: Sequence[Path]) -> None:
    """Raise InputError for fewer than two candidates, or for one given twice."""
    if len(paths) < 2:
        raise InputError(
            f"compare: {len(paths)} candidate given; give two or more designs (.toml) or "
            "results folders"
        )
    seen: dict[Path, Path] = {}
    for path in paths:
        place = path.resolve()
        if place in seen:
            raise InputError(f"{path}: given twice (as {seen[place]}); leave one out")
        seen[place] = path


def require_same_time(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """Raise InputError if treatment times differ."""
    first = designs[0].process.treatment_time_s
    for path, design in zip(paths, designs, strict=True):
        seconds = design.process.treatment_time_s
        if seconds != first:
            raise InputError(
                f"{path}: peened for {seconds:g} s, {paths[0]} for {first:g} s: coverage after "
                "different times cannot be compared; give --treatment-time-s S to simulate the "
                "others again for S seconds"
            )


def require_same_gauge(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """Raise InputError if coverage is looked at through windows of different areas."""
    first = designs[0].process.accuracy.gauge_mm2
    for path, design in zip(paths, designs, strict=True):
        gauge = design.process.accuracy.gauge_mm2
        if gauge != first:
            raise InputError(
                f"{path}: process.accuracy.gauge_mm2 is {gauge:g}, in {paths[0]} {first:g}: "
                "figures of windows of different areas cannot be compared; simulate both with one"
            )


def require_same_machine(paths: Sequence[Path], designs: Sequence[Design]) -> None:
    """Raise InputError if designs have calibrations of different machines.

    What a calibration leaves open is common to the designs that have it, and cancels.
    """
    calibrated = [pair for pair in zip(paths, designs, strict=True) if pair[1].calibration]
    for path, design in calibrated[1:]:
        if design.calibration != calibrated[0][1].calibration:
            raise InputError(
                f"{path}: another calibration than in {calibrated[0][0]}: what two calibrations "
                "leave open cannot be subtracted; simulate both designs with one"
            )


def require_same_part(
    paths: Sequence[Path], designs: Sequence[Design], meshes: Sequence[tuple[str, str]]
) -> None:
    """Raise InputError if part, unit or target differ from the first's; poses may differ.

    Args:
        paths: of the candidates.
        designs: of the candidates.
        meshes: for each candidate the sha256 of the part's file, and the unit it was read in.
    """
    for path, design, mesh in zip(paths[1:], designs[1:], meshes[1:], strict=True):
        if mesh[0] != meshes[0][0]:
            raise InputError(
                f"{path}: another part ({design.part.mesh_path.name}) than in {paths[0]} "
                f"({designs[0].part.mesh_path.name}); give candidates for the same part mesh"
            )
        pairs = {
            "unit": (meshes[0][1], mesh[1]),
            "target": (designs[0].part.target, design.part.target),
        }
        ours, others = ({one.name: one.target for one in x.zones} for x in (designs[0], design))
        pairs |= {f"zone {k}": (ours[k], others[k]) for k in ours.keys() & others.keys()}
        for name, (mine, theirs) in pairs.items():
            if mine != theirs:
                raise InputError(
                    f"{path}: part.{name} differs from {paths[0]} ({theirs} and {mine}), so the "
                    "figures are of different surfaces; simulate both with the same one"
                )


def require_same_triangles(path: Path, target: np.ndarray, first: Path, wanted: np.ndarray) -> None:
    """Raise InputError if two targets, shape (m,) bool, are not the same triangles.

    This can happen with part.target.reachable, which depends on the chamber.
    """
    if len(target) != len(wanted) or (target != wanted).any():
        raise InputError(
            f"{path}: its target of {target.sum()} triangles is not that of {first}, of "
            f"{wanted.sum()} triangles (part.target.reachable depends on the chamber); give its "
            "design instead of the result, which is then simulated with the target of the first"
        )
