"""Triangles by the names that their file gives them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError


def named(
    groups: Mapping[str, np.ndarray], names: Iterable[str], count: int, field: str
) -> np.ndarray:
    """Which of ``count`` triangles have one of the names, (count,) bool; case counts only where the file needs it to.

    "all" are all. Raises InputError, naming the design's field, for a name that the file does not have.
    """
    by_lower = {name.lower(): name for name in groups}
    chosen = np.zeros(count, dtype=bool)
    for name in names:
        known = name if name in groups else by_lower.get(name.lower())
        if name == "all" and known is None:
            chosen[:] = True
        elif known is None:
            told = (
                toml_errors.did_you_mean(name, ["all", *groups])
                if groups
                else "its file names none: 'all'"
            )
            raise InputError(f"{field}: {name!r} is no name in the part's file; {told}")
        else:
            chosen |= groups[known]
    return chosen
