"""Neighbouring triangles merged into patches that have enough dents for statistics."""

from __future__ import annotations

import numpy as np


def patches(places: np.ndarray, content: np.ndarray, minimum: float) -> np.ndarray:
    """Merge triangles into patches of at least `minimum` content, if all together have that much.

    The whole is halved across its longest side, and the halves again, as long as both sides keep
    enough. A triangle that has enough by itself can be a patch of its own. All cells of a level are
    cut at once and ties go by index, so the same input gives the same patches.

    Args:
        places: triangles that are near each other in this space may be merged, (m, d).
        content: not negative, (m,).

    Returns:
        Patch of each triangle, from 0, (m,).
    """
    m = len(content)
    if m == 0 or content.min() >= minimum:
        return np.arange(m)
    cell, open_cells, cells = np.zeros(m, dtype=int), np.ones(m, dtype=bool), 1
    while open_cells.any():
        index = np.flatnonzero(open_cells)
        names, local = np.unique(cell[index], return_inverse=True)
        low = np.full((len(names), places.shape[1]), np.inf)
        high = -low
        np.minimum.at(low, local, places[index])
        np.maximum.at(high, local, places[index])
        along = places[index, (high - low).argmax(axis=1)[local]]
        order = np.lexsort((along, local))
        index, local = index[order], local[order]
        whole = np.bincount(local, content[index])
        before = np.concatenate([[0.0], np.cumsum(whole)[:-1]])[local]
        upper = np.cumsum(content[index]) - 0.5 * content[index] - before > 0.5 * whole[local]
        above = np.bincount(local, content[index] * upper)
        cut = (above >= minimum) & (whole - above >= minimum)
        moves = cut[local] & upper
        cell[index[moves]] = (cells - 1 + np.cumsum(cut))[local[moves]]
        cells += int(cut.sum())
        open_cells[index[~cut[local]]] = False
    return np.unique(cell, return_inverse=True)[1].reshape(-1)
