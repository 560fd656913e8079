"""An eight-wide tree of bounding boxes over the obstacles. Each leaf is one obstacle.

The tree is built top down by the surface area heuristic. A group of boxes is cut where the areas of
the two halves' boxes, weighted by their numbers of obstacles, have the least sum, because flights
enter a box in proportion to its area. Eight groups make a node: the largest group is cut again
until there are eight. Leaves hold a single obstacle, so that the box test, eight at once, decides
which exact tests are worth their cost.

Sources: Goldsmith & Salmon, IEEE Computer Graphics and Applications 7(5) (1987) 14; Wald, Benthin &
Boulos, IEEE Symposium on Interactive Ray Tracing 2008.
"""

from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.obstacles import ObstacleTable
from sim_core.numerics.jit import jit
from sim_core.numerics.simd import BOXES

FAR = np.float32(1e30)  # an empty child is a box that no flight reaches
MAX_LEVELS = 64  # a tree of 10 million obstacles has about 10
STACK = BOXES * MAX_LEVELS  # a walk keeps at most 7 siblings a level
BINS = 16  # cuts tried along each axis; 8 to 32 measured alike
EMPTY = -(2**31)


class _Boxes(NamedTuple):
    """Bounding boxes of the obstacles, and their order in the tree."""

    low: np.ndarray  # lowest corners [m], shape (k, 3)
    high: np.ndarray  # highest corners [m], shape (k, 3)
    order: np.ndarray  # obstacle of each leaf, shape (k,); sorted as the tree grows


class Tree(NamedTuple):
    """Obstacles and their boxes, ready for compiled code, relative to the scene's centre.

    Obstacles that are neighbours in space are near each other in memory.
    """

    # low x, y, z and high x, y, z of each node's children, shape (nodes, 6, 8) float32, padded
    # outward
    bounds: np.ndarray
    # node number if >= 0, else the obstacle -1 - child, shape (nodes, 8) int32
    children: np.ndarray
    numbers: np.ndarray  # as in ObstacleTable, shape (k, 20)
    kinds: np.ndarray  # as in ObstacleTable, shape (k,)
    triangles: np.ndarray  # as in ObstacleTable, shape (k, 2)
    radius: float  # radius of the balls that the obstacles are for [m]


def build_tree(table: ObstacleTable, radius: float) -> Tree:
    """Build the tree over the obstacles for balls of this radius [m]."""
    count = len(table.low)
    size = max(np.abs(table.low).max(), np.abs(table.high).max())
    # float32 boxes are never smaller than the float64 ones
    pad = 16.0 * np.finfo(np.float32).eps * size
    low, high = table.low - pad, table.high + pad
    order = np.arange(count)
    most = count + 2  # a node has at least two children
    bounds = np.full((most, 6, BOXES), FAR, dtype=np.float32)
    children = np.full((most, BOXES), EMPTY, dtype=np.int32)
    ranges = np.zeros((most, 3), dtype=np.int64)  # first and last obstacle, and level, of each node
    bins, groups = np.zeros((2, BINS, 7)), np.zeros((BOXES, 2), np.int64)
    nodes = _grow(_Boxes(low, high, order), bounds, children, ranges, bins[0], bins[1], groups)
    if ranges[:nodes, 2].max() > MAX_LEVELS:
        raise SceneError(
            "the mesh's triangles are spread so unevenly that their tree is more than "
            f"{MAX_LEVELS} levels deep; look for triangles crowded into one point"
        )
    return Tree(
        np.ascontiguousarray(bounds[:nodes]),
        np.ascontiguousarray(children[:nodes]),
        np.ascontiguousarray(table.numbers[order]),
        np.ascontiguousarray(table.kinds[order]),
        np.ascontiguousarray(table.triangles[order]),
        radius,
    )


def join_trees(trees: list[Tree]) -> tuple[Tree, np.ndarray]:
    """Join the trees for several ball radii into one tree, which has the radius of the last tree.

    Returns: the tree, and the node at which each of the k trees begins, shape (k,).
    """
    if len(trees) == 1:
        return trees[0], np.zeros(1, dtype=np.int64)
    roots = np.cumsum([0, *(len(tree.children) for tree in trees[:-1])])
    rows = np.cumsum([0, *(len(tree.kinds) for tree in trees[:-1])])
    children = [
        np.where(
            tree.children >= 0,
            tree.children + root,
            np.where(tree.children == EMPTY, EMPTY, tree.children - row),
        )
        for tree, root, row in zip(trees, roots, rows, strict=True)
    ]
    whole = Tree(
        np.concatenate([tree.bounds for tree in trees]),
        np.concatenate(children).astype(np.int32),
        np.concatenate([tree.numbers for tree in trees]),
        np.concatenate([tree.kinds for tree in trees]),
        np.concatenate([tree.triangles for tree in trees]),
        trees[-1].radius,
    )
    return whole, roots.astype(np.int64)


@jit
def _grow(
    boxes: _Boxes,
    bounds: np.ndarray,
    children: np.ndarray,
    ranges: np.ndarray,
    bins: np.ndarray,
    sweep: np.ndarray,
    groups: np.ndarray,
) -> int:
    """Build the nodes of the tree from the root down: fill ``bounds`` and ``children``.

    ``boxes.order`` is sorted so that leaf i holds obstacle order[i]. ``ranges``, ``bins``,
    ``sweep`` and ``groups`` are working arrays.

    Returns: the number of nodes.
    """
    low, high, order = boxes.low, boxes.high, boxes.order
    ranges[0, 0], ranges[0, 1], ranges[0, 2] = 0, len(order), 1
    nodes = 1
    node = 0
    while node < nodes:
        groups[0, 0], groups[0, 1] = ranges[node, 0], ranges[node, 1]
        count = 1
        while count < BOXES:
            chosen, widest = -1, -1.0
            for g in range(count):
                if groups[g, 1] - groups[g, 0] > 1:
                    area = _area_of(boxes, groups[g, 0], groups[g, 1])
                    if area > widest:
                        chosen, widest = g, area
            if chosen < 0:
                break
            cut = _cut(boxes, groups[chosen, 0], groups[chosen, 1], bins, sweep)
            groups[count, 0], groups[count, 1] = cut, groups[chosen, 1]
            groups[chosen, 1] = cut
            count += 1
        for g in range(count):
            start, end = groups[g, 0], groups[g, 1]
            for axis in range(3):
                lowest, highest = np.inf, -np.inf
                for k in range(start, end):
                    lowest = min(lowest, low[order[k], axis])
                    highest = max(highest, high[order[k], axis])
                bounds[node, axis, g] = np.float32(lowest)
                bounds[node, 3 + axis, g] = np.float32(highest)
            if end - start == 1:
                children[node, g] = -1 - start
            else:
                children[node, g] = nodes
                ranges[nodes, 0], ranges[nodes, 1] = start, end
                ranges[nodes, 2] = ranges[node, 2] + 1
                nodes += 1
        node += 1
    return nodes


@jit
def _area_of(boxes: _Boxes, start: int, end: int) -> float:
    """Return half the surface area [m²] of the box around obstacles ``start`` to ``end``."""
    low, high, order = boxes.low, boxes.high, boxes.order
    x0, y0, z0, x1, y1, z1 = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    for k in range(start, end):
        i = order[k]
        x0, y0, z0 = min(x0, low[i, 0]), min(y0, low[i, 1]), min(z0, low[i, 2])
        x1, y1, z1 = max(x1, high[i, 0]), max(y1, high[i, 1]), max(z1, high[i, 2])
    return (x1 - x0) * (y1 - y0) + (y1 - y0) * (z1 - z0) + (z1 - z0) * (x1 - x0)


@jit
def _half_area(box: np.ndarray, row: int) -> float:
    x, y, z = box[row, 3] - box[row, 0], box[row, 4] - box[row, 1], box[row, 5] - box[row, 2]
    return float(x * y + y * z + z * x)


@jit
def _widen(box: np.ndarray, row: int, boxes: _Boxes, i: int) -> None:
    for axis in range(3):
        box[row, axis] = min(box[row, axis], boxes.low[i, axis])
        box[row, 3 + axis] = max(box[row, 3 + axis], boxes.high[i, axis])


@jit
def _merge(box: np.ndarray, row: int, other: np.ndarray, other_row: int) -> None:
    for axis in range(3):
        box[row, axis] = min(box[row, axis], other[other_row, axis])
        box[row, 3 + axis] = max(box[row, 3 + axis], other[other_row, 3 + axis])
    box[row, 6] += other[other_row, 6]


@jit
def _cheapest(bins: np.ndarray, left: np.ndarray) -> tuple[float, int]:
    """Find the cut between ``bins`` with the least sum of box area times number of obstacles.

    Bins are equal slices of a group of obstacles along one axis. ``left`` is a working array.

    Returns: this sum [m²], and the last bin before the cut.
    """
    _clear(left)
    for b in range(BINS):  # left[b]: all bins up to b
        if b > 0:
            _merge(left, b, left, b - 1)
        _merge(left, b, bins, b)
    best, place = np.inf, 0
    for b in range(BINS - 1, 0, -1):  # bins[b]: all bins from b on
        if b < BINS - 1:
            _merge(bins, b, bins, b + 1)
        if bins[b, 6] > 0.0 and left[b - 1, 6] > 0.0:
            cost = _half_area(bins, b) * bins[b, 6] + _half_area(left, b - 1) * left[b - 1, 6]
            if cost < best:
                best, place = cost, b - 1
    return best, place


@jit
def _clear(bins: np.ndarray) -> None:
    for b in range(BINS):
        for axis in range(3):
            bins[b, axis] = np.inf
            bins[b, 3 + axis] = -np.inf
        bins[b, 6] = 0.0


@jit
def _bin_of(boxes: _Boxes, i: int, axis: int, first: float, scale: float) -> int:
    middle = 0.5 * (boxes.low[i, axis] + boxes.high[i, axis])
    return min(BINS - 1, int((middle - first) * scale))


@jit
def _cut(boxes: _Boxes, start: int, end: int, bins: np.ndarray, sweep: np.ndarray) -> int:
    """Cut a group of obstacles in two, at the cheapest of BINS - 1 planes across each axis.

    The group is ``start`` to ``end`` of ``boxes.order``. This piece of the order is sorted so that
    the first part comes before the second.

    Returns: the start of the second part.
    """
    low, high, order = boxes.low, boxes.high, boxes.order
    best, best_axis, best_bin, best_first, best_scale = np.inf, -1, 0, 0.0, 0.0
    for axis in range(3):
        first, last = np.inf, -np.inf
        for k in range(start, end):
            middle = 0.5 * (low[order[k], axis] + high[order[k], axis])
            first, last = min(first, middle), max(last, middle)
        if not last > first:
            continue
        scale = BINS / (last - first)
        _clear(bins)
        for k in range(start, end):
            i = order[k]
            b = _bin_of(boxes, i, axis, first, scale)
            _widen(bins, b, boxes, i)
            bins[b, 6] += 1.0
        cost, place = _cheapest(bins, sweep)
        if cost < best:
            best, best_axis, best_bin, best_first, best_scale = cost, axis, place, first, scale
    if best_axis < 0:
        return (start + end) // 2  # all centres lie in one point
    left, right = start, end - 1
    while left <= right:
        if _bin_of(boxes, order[left], best_axis, best_first, best_scale) <= best_bin:
            left += 1
        else:
            order[left], order[right] = order[right], order[left]
            right -= 1
    return left
