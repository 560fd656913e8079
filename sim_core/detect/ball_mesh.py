"""Which obstacle a ball meets first: a walk down the tree along one piece of its parabola, nearest boxes first."""

from typing import NamedTuple

import numpy as np

from sim_core.contact.path_end import out_of_reach
from sim_core.detect.ball_cylinder import bore_delay, is_round
from sim_core.detect.ball_sonotrode import (
    meets_later,
    same_plane,
    waving_plane_delay,
    within_waving_borders,
)
from sim_core.detect.ball_triangle import capsule_delay, face_delay
from sim_core.effects.contact_mode import ContactState
from sim_core.effects.gravity import Gravity, gravity_acceleration
from sim_core.effects.sonotrodes import Waves, face_wave, move_alike
from sim_core.effects.vibration import Wave
from sim_core.geometry.ball_sizes import Sizes, own_radius, own_root
from sim_core.geometry.bvh import STACK, Tree
from sim_core.geometry.obstacles import CAPSULE, FACE, Bore
from sim_core.motion import Point
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.simd import BOXES, boxes_hit, lowest_bit
from sim_core.numerics.vec3 import Vec3

SLACK = np.float32(
    1.000001
)  # on float32 times: ten times their rounding, so that an equal time is never pruned
TINY = 1e-30  # stands for a chord component of zero, whose inverse would be infinite


class Scratch(NamedTuple):
    """Working space of one simulation, made once: a flight's chord, boxes' entry times, and the stack."""

    ray: np.ndarray
    enter: np.ndarray
    nodes: np.ndarray
    times: np.ndarray


def new_scratch() -> Scratch:
    """Fresh working space."""
    return Scratch(
        np.zeros(9, dtype=np.float32),
        np.zeros(BOXES, dtype=np.float32),
        np.zeros(STACK, dtype=np.int64),
        np.zeros(STACK, dtype=np.float32),
    )


@jit
def _aim(ray: np.ndarray, ball: Point, acceleration: Vec3, length: float) -> None:
    """Chord of the arc of ``length`` [s]: lower and upper origins (0:3, 3:6), inverse velocity (6:9).

    The arc lies between its chord and the chord shifted by -a T²/8; the two origins are those of the two.
    """
    bulge = -0.125 * length * length
    for axis in range(3):
        origin = ball.position[axis]
        shift = bulge * acceleration[axis]
        speed = ball.velocity[axis] + 0.5 * length * acceleration[axis]
        if abs(speed) < TINY:
            speed = TINY
        ray[axis] = np.float32(origin + max(shift, 0.0))
        ray[3 + axis] = np.float32(origin + min(shift, 0.0))
        ray[6 + axis] = np.float32(1.0 / speed)


@inlined
def stack_children(tree: Tree, scratch: Scratch, node: int, depth: int, longest: np.float32) -> int:
    """Put those children of a node on the stack that the flight enters within ``longest`` [s], nearest on top; its new
    depth.
    """
    hits = boxes_hit(tree.bounds, node, scratch.ray, longest, scratch.enter)
    floor = depth
    while hits != 0:
        child = lowest_bit(hits)
        hits &= hits - 1
        enter = scratch.enter[child]
        slot = depth
        while slot > floor and scratch.times[slot - 1] < enter:
            scratch.times[slot] = scratch.times[slot - 1]
            scratch.nodes[slot] = scratch.nodes[slot - 1]
            slot -= 1
        scratch.times[slot] = enter
        scratch.nodes[slot] = tree.children[node, child]
        depth += 1
    return depth


@inlined
def first_contact(
    tree: Tree,
    scratch: Scratch,
    ball: Point,
    gravity: Gravity | None,
    wave: Wave | None,
    seam: float,
    time: float,
    length: float,
) -> tuple[float, int]:
    """Delay [s] and obstacle of the first contact within ``length`` [s]; (NEVER, -1) if there is none.

    ``time`` [s]: now, on the window's clock (the sonotrode's phase depends on it). Ties go to the obstacle stored
    first.
    """
    acceleration = gravity_acceleration(gravity)
    return first_contact_from(
        None, None, None, -1, tree, scratch, ball, acceleration, wave, None, seam, time, length
    )


@inlined
def first_contact_from(
    contact: ContactState | None,
    sizes: Sizes | None,
    bore: Bore | None,
    number: int,
    tree: Tree,
    scratch: Scratch,
    ball: Point,
    acceleration: Vec3,
    wave: Wave | None,
    waves: Waves | None,
    seam: float,
    time: float,
    length: float,
) -> tuple[float, int]:
    """The same for ball ``number``, under its own acceleration ``acceleration`` [m/s²], with what it stands on left out;

    of several ``sizes`` it has obstacles of its own, in a ``bore`` one that is round; of several ``waves`` each
    sonotrode has its own.
    """
    radius = own_radius(sizes, tree.radius, number)
    _aim(scratch.ray, ball, acceleration, length)
    best = length
    found = -1
    plane_row = -1  # a sonotrode's faces share a plane: its equation is solved once a query
    plane_delay = NEVER
    scratch.nodes[0] = own_root(sizes, number)
    scratch.times[0] = np.float32(0.0)
    depth = 1
    while depth > 0:
        depth -= 1
        longest = np.float32(best) * SLACK
        if scratch.times[depth] > longest:
            continue
        code = scratch.nodes[depth]
        if code < 0:
            row = -1 - code
            kind = tree.kinds[row]
            if kind == FACE:
                delay = face_delay(tree.numbers, row, ball, acceleration, radius, seam)
            elif kind == CAPSULE:
                delay = capsule_delay(tree.numbers, row, ball, acceleration, radius, best)
            elif is_round(bore, kind):
                delay = bore_delay(bore, tree.numbers, row, ball)
            else:
                own = face_wave(waves, wave, row)
                if plane_row < 0 or not (
                    same_plane(tree.numbers, row, plane_row) and move_alike(waves, row, plane_row)
                ):
                    if plane_row >= 0 and plane_delay < best:  # and no face was there
                        last = face_wave(waves, wave, plane_row)
                        later, face = meets_later(
                            tree,
                            waves,
                            radius,
                            plane_row,
                            ball,
                            acceleration,
                            seam,
                            last,
                            time,
                            plane_delay,
                            best,
                        )
                        if face >= 0:
                            best, found = later, face
                    plane_row = row
                    plane_delay = waving_plane_delay(
                        tree.numbers, row, ball, acceleration, radius, own, time, best
                    )
                delay = plane_delay
                if delay <= best and not within_waving_borders(
                    tree.numbers, row, ball, acceleration, seam, own, time, delay
                ):
                    delay = NEVER
            if out_of_reach(contact, tree, number, ball.position, row):
                delay = NEVER
            if delay < best or (delay == best and (found < 0 or row < found)):
                best = delay
                found = row
            continue
        depth = stack_children(tree, scratch, code, depth, longest)
    if plane_row >= 0 and plane_delay < best:  # and no face was there
        last = face_wave(waves, wave, plane_row)
        later, face = meets_later(
            tree, waves, radius, plane_row, ball, acceleration, seam, last, time, plane_delay, best
        )
        if face >= 0:
            return later, face
    if found < 0:
        return NEVER, -1
    return best, found
