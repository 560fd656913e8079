"""Binary trees of boxes, built top down by the surface area heuristic.

The caller chooses the kind of box. One builder makes both kinds, so that they differ only in that.
The frame of a group is either the world's axes or the principal axes of its points (Gottschalk, Lin
& Manocha, SIGGRAPH 1996, 171). The group is cut along an axis of its frame, at the cheapest of 15
places.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.structures.compiled import jit, searches
from benchmarks.structures.mesh_obstacles import (
    Rows,
    Shell,
    answer,
    chord_of,
    nearer,
    padding,
    sort_rows,
    within_slab,
)
from sim_core.numerics.vec3 import Vec3, dot

LEAF = 4  # obstacles a leaf holds at most; 1 measured 10 % slower, 2 and 8 alike
BINS = 16
STACK = 128
_builder = partial(jit, arrays=True)


class BinaryTree(NamedTuple):
    """The arrays of a tree.

    ``frames`` (nodes, 3, 3) float32 has the axes of a node's box as rows, or is None for the
    world's axes. ``slabs`` (nodes, 6) float32 [m] gives the low and high bound along each axis.
    ``links`` (nodes, 2) int32 holds the first child (the second follows it) and 0, or the first row
    and the number of rows.
    """

    frames: np.ndarray | None
    slabs: np.ndarray
    links: np.ndarray
    rows: Rows
    stack: tuple[np.ndarray, np.ndarray]


def build(shell: Shell, oriented: bool) -> BinaryTree:
    """A tree over the shell's obstacles."""
    order = np.arange(len(shell.kinds))
    most = 2 * len(order)
    frames = np.zeros((most, 3, 3), dtype=np.float32)
    slabs, links = np.zeros((most, 6), dtype=np.float32), np.zeros((most, 2), dtype=np.int32)
    nodes = _grow(shell.points, shell.grow + padding(shell), order, oriented, frames, slabs, links)
    stack = (np.zeros(STACK, dtype=np.int64), np.zeros(STACK))
    return BinaryTree(
        frames[:nodes].copy() if oriented else None,
        slabs[:nodes].copy(),
        links[:nodes].copy(),
        sort_rows(shell, order),
        stack,
    )


@searches(BinaryTree)
def nearest(tree, ball, fall, length):  # type: ignore[no-untyped-def]
    """Delay [s] and obstacle of the first contact within ``length`` [s]; the nearer child first."""
    nodes, times = tree.stack
    chord = chord_of(ball, fall, length)
    best, found = length, -1
    nodes[0], times[0], depth = 0, 0.0, 1
    while depth > 0:
        depth -= 1
        if times[depth] > best:
            continue
        first, count = int(tree.links[nodes[depth], 0]), int(tree.links[nodes[depth], 1])
        if count > 0:
            for row in range(first, first + count):
                best, found = nearer(tree.rows, row, ball, fall, best, found)
            continue
        one = _enter(tree.frames, tree.slabs, first, chord, best)
        two = _enter(tree.frames, tree.slabs, first + 1, chord, best)
        near, far = first, first + 1
        if two < one:
            near, far, one, two = far, near, two, one
        if two <= best:
            nodes[depth], times[depth] = far, two
            depth += 1
        if one <= best:
            nodes[depth], times[depth] = near, one
            depth += 1
    return answer(tree.rows, best, found)


@jit
def _enter(frames, slabs, node, chord, longest):  # type: ignore[no-untyped-def]
    """When [s] the chord enters the node's box, or a time later than ``longest``."""
    enter, leave = 0.0, longest
    for axis in range(3):
        low, high = slabs[node, axis], slabs[node, 3 + axis]
        if frames is None:
            origin, velocity, bulge = chord.origin[axis], chord.velocity[axis], chord.bulge[axis]
        else:
            a = Vec3(frames[node, axis, 0], frames[node, axis, 1], frames[node, axis, 2])
            origin, velocity, bulge = (
                dot(a, chord.origin),
                dot(a, chord.velocity),
                dot(a, chord.bulge),
            )
        enter, leave = within_slab(origin, velocity, bulge, low, high, enter, leave)
    return enter if enter <= leave else 2.0 * longest


@_builder
def _grow(points, grow, order, oriented, frames, slabs, links):  # type: ignore[no-untyped-def]
    """Fills the tree and returns the number of nodes.

    ``order`` is sorted so that the obstacles of a leaf are consecutive rows.
    """
    boxes = np.empty((len(order), 6))  # of each obstacle, in its group's frame
    links[0, 1] = len(order)
    nodes, node = 1, 0
    while node < nodes:
        start, end = links[node, 0], links[node, 0] + links[node, 1]  # a node begins as a leaf
        frame = _principal_axes(points, order, start, end) if oriented else np.eye(3)
        for axis in range(3):
            frames[node, axis, 0], frames[node, axis, 1], frames[node, axis, 2] = frame[:, axis]
            x, y, z = frames[node, axis]
            slabs[node, axis], slabs[node, 3 + axis] = np.inf, -np.inf
            for k in range(start, end):
                i = order[k]
                one = points[i, 0, 0] * x + points[i, 0, 1] * y + points[i, 0, 2] * z
                two = points[i, 1, 0] * x + points[i, 1, 1] * y + points[i, 1, 2] * z
                three = points[i, 2, 0] * x + points[i, 2, 1] * y + points[i, 2, 2] * z
                boxes[i, axis] = min(one, two, three) - grow[i]
                boxes[i, 3 + axis] = max(one, two, three) + grow[i]
                slabs[node, axis] = min(slabs[node, axis], boxes[i, axis])
                slabs[node, 3 + axis] = max(slabs[node, 3 + axis], boxes[i, 3 + axis])
        if end - start > LEAF:
            cut = _cut(boxes, order, start, end)
            links[node, 0], links[node, 1] = nodes, 0
            links[nodes, 0], links[nodes, 1] = start, cut - start
            links[nodes + 1, 0], links[nodes + 1, 1] = cut, end - cut
            nodes += 2
        node += 1
    return nodes


@_builder
def _principal_axes(points, order, start, end):  # type: ignore[no-untyped-def]
    """The axes as columns, (3, 3)."""
    spread, mean = np.zeros((3, 3)), np.zeros(3)
    for k in range(start, end):
        for corner in range(3):
            for a in range(3):
                mean[a] += points[order[k], corner, a] / (3 * (end - start))
    for k in range(start, end):
        for corner in range(3):
            p = points[order[k], corner]
            for a in range(3):
                for b in range(3):
                    spread[a, b] += (p[a] - mean[a]) * (p[b] - mean[b])
    return np.linalg.eigh(spread)[1]


@_builder
def _cut(boxes, order, start, end):  # type: ignore[no-untyped-def]
    """Sort a group in two; returns where the second begins."""
    cheapest, chosen, place = np.inf, 0, np.inf
    bins, side, price = np.empty((BINS, 7)), np.empty((1, 7)), np.empty(BINS)
    for axis in range(3):
        first, last = np.inf, -np.inf
        for k in range(start, end):
            middle = boxes[order[k], axis] + boxes[order[k], 3 + axis]
            first, last = min(first, middle), max(last, middle)
        if not last > first:
            continue
        for b in range(BINS):
            _clear(bins, b)
        for k in range(start, end):
            middle = boxes[order[k], axis] + boxes[order[k], 3 + axis]
            b = min(BINS - 1, int((middle - first) / (last - first) * BINS))
            _widen(bins, b, boxes, order[k], 1.0)
        _clear(side, 0)
        for b in range(1, BINS):  # price[b]: the bins before b on one side, the others on the other
            _widen(side, 0, bins, b - 1, bins[b - 1, 6])
            price[b] = _price(side)
        _clear(side, 0)
        for b in range(BINS - 1, 0, -1):
            _widen(side, 0, bins, b, bins[b, 6])
            price[b] += _price(side)
            if price[b] < cheapest:
                cheapest, chosen, place = price[b], axis, first + (last - first) * b / BINS
    left, right = start, end
    while left < right:
        i = order[left]
        if boxes[i, chosen] + boxes[i, 3 + chosen] < place:
            left += 1
        else:
            right -= 1
            order[left], order[right] = order[right], i
    return left if start < left < end else (start + end) // 2  # all middles in one point


@_builder
def _clear(boxes, row):  # type: ignore[no-untyped-def]
    for axis in range(3):
        boxes[row, axis], boxes[row, 3 + axis] = np.inf, -np.inf
    boxes[row, 6] = 0.0


@_builder
def _widen(boxes, row, others, other, count):  # type: ignore[no-untyped-def]
    for axis in range(3):
        boxes[row, axis] = min(boxes[row, axis], others[other, axis])
        boxes[row, 3 + axis] = max(boxes[row, 3 + axis], others[other, 3 + axis])
    boxes[row, 6] += count


@_builder
def _price(side):  # type: ignore[no-untyped-def]
    """Half the box's area by what it holds; an empty side is no cut."""
    x, y, z = side[0, 3] - side[0, 0], side[0, 4] - side[0, 1], side[0, 5] - side[0, 2]
    return (x * y + y * z + z * x) * side[0, 6] if side[0, 6] > 0.0 else np.inf
