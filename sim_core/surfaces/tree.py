"""An eight-wide tree of bounding boxes over the obstacles.

Built level by level with numpy: each node's obstacles are halved three times at the median of their centres along
the longest side, giving eight children; a child of at most LEAF obstacles is a leaf. Median splits make the depth
log8(obstacles), whatever their sizes.
"""

from typing import NamedTuple

import numpy as np

from sim_core.simd import BOXES
from sim_core.surfaces.obstacles import Obstacles

LEAF = 4  # obstacles in a leaf: fewer cost more nodes, more cost more exact tests (3-6 measured alike)
LEAF_BITS = 4  # a leaf is stored as -(first << LEAF_BITS | count) - 1
FAR = np.float32(1e30)  # an empty child is a box no flight reaches
STACK = 8 * 24  # 8 children a level, 24 levels: more than 8^24 obstacles


class Tree(NamedTuple):
    """The obstacles and their boxes, ready for compiled code; coordinates relative to the scene's centre.

    ``bounds`` (nodes, 6, 8) float32: low x, y, z and high x, y, z of each node's eight children, padded outward;
    ``children`` (nodes, 8) int32: >= 0 a node, < 0 a leaf; ``numbers``, ``kinds``, ``triangles``: the obstacles in
    leaf order; ``radius`` [m] of the balls they were made for.
    """

    bounds: np.ndarray
    children: np.ndarray
    numbers: np.ndarray
    kinds: np.ndarray
    triangles: np.ndarray
    radius: float


def build_tree(obstacles: Obstacles, radius: float) -> Tree:
    """The tree over the obstacles of balls of this radius [m]."""
    pad = 16.0 * np.finfo(np.float32).eps * max(np.abs(obstacles.low).max(), np.abs(obstacles.high).max())
    low, high = obstacles.low - pad, obstacles.high + pad
    centre = 0.5 * (low + high)
    order = np.arange(len(low))
    starts, ends = np.array([0]), np.array([len(low)])
    bounds: list[np.ndarray] = []
    children: list[np.ndarray] = []
    nodes = 0
    while len(starts):  # one level of the tree at a time
        edges = np.stack([starts, ends], axis=1)
        for _ in range(3):
            order, edges = _halve(order, edges, centre)
        first, last = edges.reshape(-1, BOXES, 2)[..., 0], edges.reshape(-1, BOXES, 2)[..., 1]
        count = last - first
        nodes += len(starts)
        leaf = count <= LEAF
        code = -((first << LEAF_BITS) | count) - 1
        inner = np.flatnonzero(~leaf.reshape(-1))
        code.reshape(-1)[inner] = nodes + np.arange(len(inner))
        bounds.append(_bounds(order, first, last, low, high))
        children.append(code.astype(np.int32))
        starts, ends = first.reshape(-1)[inner], last.reshape(-1)[inner]
    return Tree(
        np.ascontiguousarray(np.concatenate(bounds)),
        np.ascontiguousarray(np.concatenate(children)),
        np.ascontiguousarray(obstacles.numbers[order]),
        np.ascontiguousarray(obstacles.kinds[order]),
        np.ascontiguousarray(obstacles.triangles[order]),
        radius,
    )


def _halve(order: np.ndarray, edges: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split every range of ``order`` at the median along its longest side; ranges that fit a leaf stay whole."""
    start, end = edges[:, 0], edges[:, 1]
    middle = np.where(end - start > LEAF, (start + end) // 2, end)
    busy = np.flatnonzero(end - start > LEAF)
    if len(busy):
        sizes = end[busy] - start[busy]
        where = np.repeat(start[busy] - np.concatenate([[0], np.cumsum(sizes)[:-1]]), sizes) + np.arange(sizes.sum())
        owner = np.repeat(np.arange(len(busy)), sizes)
        points = centre[order[where]]
        heads = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        extent = np.maximum.reduceat(points, heads) - np.minimum.reduceat(points, heads)
        key = points[np.arange(len(points)), extent.argmax(axis=1)[owner]]
        order = order.copy()
        order[where] = order[where][np.lexsort((key, owner))]
    return order, np.stack([np.stack([start, middle], axis=1), np.stack([middle, end], axis=1)], axis=1).reshape(-1, 2)


def _bounds(order: np.ndarray, first: np.ndarray, last: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Boxes (nodes, 6, 8) of the children; float32, never smaller than the float64 box."""
    nodes = len(first)
    boxes = np.full((nodes, 6, BOXES), FAR, dtype=np.float32)
    node, child = np.nonzero(last > first)
    begin, end = first[node, child], last[node, child]
    # children of a level lie one after another but for gaps between nodes: reduce over [begin, end) pairs
    cuts = np.stack([begin, end], axis=1).reshape(-1)
    padded = np.concatenate([order, order[-1:]])
    lows = np.minimum.reduceat(low[padded], cuts)[::2]
    highs = np.maximum.reduceat(high[padded], cuts)[::2]
    boxes[node, 0:3, child] = lows
    boxes[node, 3:6, child] = highs
    return boxes
