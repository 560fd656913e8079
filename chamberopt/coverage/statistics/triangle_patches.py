"""Neighbouring triangles taken together, until each patch has enough dents to say something."""

from __future__ import annotations

import numpy as np


def patches(places: np.ndarray, content: np.ndarray, least: float) -> np.ndarray:
    """The patch of each triangle, (m,) from 0: none holds less than `least` of the content unless all of it is one.

    places (m, d): what is near in it may be joined (middle points, say, and normals) · content (m,), not negative.
    Halves the whole across its longest side, and the halves again, as long as both sides keep enough; a
    triangle that holds enough by itself can stand alone. All cells of a level are cut at once, ties by index:
    the same input gives the same patches.
    """
    m = len(content)
    if m == 0 or content.min() >= least:
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
        cut = (above >= least) & (whole - above >= least)
        moves = cut[local] & upper
        cell[index[moves]] = (cells - 1 + np.cumsum(cut))[local[moves]]
        cells += int(cut.sum())
        open_cells[index[~cut[local]]] = False
    return np.unique(cell, return_inverse=True)[1].reshape(-1)
