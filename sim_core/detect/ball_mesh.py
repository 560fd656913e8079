"""Search for the first obstacle that a ball hits on its parabola, by a tree of boxes."""

from typing import NamedTuple

import numpy as np

from sim_core.contact.path_end import out_of_reach
from sim_core.contact.riding import moves_with_face
from sim_core.detect.ball_cylinder import is_cylinder_wall, wall_delay
from sim_core.detect.ball_sonotrode import (
    find_later_contact,
    vibrating_plane_delay,
    within_moved_borders,
)
from sim_core.detect.ball_triangle import capsule_delay, face_delay
from sim_core.effects.amplitude_profile import FaceProfiles
from sim_core.effects.ball_sizes import BallSizes, radius_of_ball, root_of_ball
from sim_core.effects.contact_mode import ContactState
from sim_core.effects.sonotrodes import SonotrodeWaves, same_sonotrode, wave_of_face
from sim_core.effects.vibration import Wave
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.bvh import STACK, Tree
from sim_core.geometry.obstacles import CAPSULE, FACE, same_plane
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.simd import BOXES, boxes_hit, lowest_bit
from sim_core.numerics.vec3 import Flight

# Factor on float32 times: ten times their rounding, so that an equal time is never left out.
SLACK = np.float32(1.000001)
TINY = 1e-30  # replaces a chord component of zero, whose inverse would be infinite


class Scratch(NamedTuple):
    """Working arrays for the search down the tree of boxes, allocated once a simulation."""

    ray: np.ndarray  # chord of a flight, see aim_ray, shape (9,) float32
    enter: np.ndarray  # entry times into the boxes of a node's children [s], shape (8,) float32
    nodes: np.ndarray  # stack of nodes still to visit, int64
    times: np.ndarray  # entry times of the stacked nodes [s], float32


def new_scratch() -> Scratch:
    """Return new working arrays for the search down the tree of boxes."""
    return Scratch(
        np.zeros(9, dtype=np.float32),
        np.zeros(BOXES, dtype=np.float32),
        np.zeros(STACK, dtype=np.int64),
        np.zeros(STACK, dtype=np.float32),
    )


@jit
def aim_ray(ray: np.ndarray, ball: Flight, length: float, error: float) -> None:
    """Write the straight line between the two ends of a flight, the chord, into ``ray``.

    ``ray`` holds upper origin (0:3), lower origin (3:6) and inverse velocity (6:9).

    A flight of acceleration a lies between its chord and the chord shifted by -a T²/8. The origins
    are the upper and lower bound of the starts of these two lines, moved apart by ``error``.

    Args:
        ray: output array, shape (9,) float32.
        ball: the flight from now on.
        length: duration T of the flight [s].
        error: largest distance of the path from the parabola [m].
    """
    bulge = -0.125 * length * length
    for axis in range(3):
        origin = ball.position[axis]
        shift = bulge * ball.acceleration[axis]
        speed = ball.velocity[axis] + 0.5 * length * ball.acceleration[axis]
        if abs(speed) < TINY:
            speed = TINY
        ray[axis] = np.float32(origin + max(shift, 0.0) + error)
        ray[3 + axis] = np.float32(origin + min(shift, 0.0) - error)
        ray[6 + axis] = np.float32(1.0 / speed)


@inlined
def stack_children(tree: Tree, scratch: Scratch, node: int, depth: int, longest: np.float32) -> int:
    """Put the child boxes of a tree node that a flight enters on the stack, the earliest on top.

    Args:
        tree: tree of the obstacles.
        scratch: working arrays with the stack. Its ``ray`` holds the flight.
        node: number of the tree node.
        depth: number of entries on the stack.
        longest: boxes that are entered later than this [s] are left out.

    Returns: the new number of entries on the stack.
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
    contact: ContactState | None,
    sizes: BallSizes | None,
    cylinder: CylinderAxis | None,
    number: int,
    tree: Tree,
    scratch: Scratch,
    ball: Flight,
    wave: Wave | None,
    waves: SonotrodeWaves | None,
    profiles: FaceProfiles | None,
    face_overlap: float,
    time: float,
    length: float,
) -> tuple[float, int]:
    """Find the first hit of a ball on any obstacle that does not belong to the turning part.

    The obstacle stored first wins a tie.

    Args:
        contact: state of contact mode. Obstacles in contact with the ball are left out.
        sizes: sizes of balls that are not all alike. Each size has its own obstacles.
        cylinder: axis of an analytical cylinder.
        number: number of the ball. It is unused if ``contact`` and ``sizes`` are None.
        tree: tree of the obstacles.
        scratch: working arrays.
        ball: the ball's flight from now on, with its own acceleration.
        wave: vibration of the only sonotrode, or of the slowest one.
        waves: vibrations of several sonotrodes.
        profiles: amplitude over the faces of sonotrodes that bend.
        face_overlap: overlap of neighbouring faces [m].
        time: time since the start of the present time window [s]. The phase of a sonotrode depends
            on it.
        length: duration of the search [s].

    Returns:
        Delay [s] and obstacle number of the contact, or (NEVER, -1) if there is none within
        ``length``.
    """
    radius = radius_of_ball(sizes, tree.radius, number)
    aim_ray(scratch.ray, ball, length, 0.0)
    best = length
    found = -1
    # The faces of a sonotrode share a plane, whose equation is solved once a query. plane_row is
    # the last face whose equation was solved.
    plane_row = -1
    plane_delay = NEVER
    scratch.nodes[0] = root_of_ball(sizes, number)
    scratch.times[0] = np.float32(0.0)
    depth = 1
    while depth > 0:
        depth -= 1
        longest = np.float32(best) * SLACK
        if scratch.times[depth] > longest:
            continue
        code = scratch.nodes[depth]
        if code >= 0:
            depth = stack_children(tree, scratch, code, depth, longest)
            continue
        row = -1 - code
        kind = tree.kinds[row]
        if kind == FACE:
            delay = face_delay(tree.numbers, row, ball, radius, face_overlap)
        elif kind == CAPSULE:
            delay = capsule_delay(tree.numbers, row, ball, radius, best)
        elif is_cylinder_wall(cylinder, kind):
            delay = wall_delay(cylinder, contact, tree.numbers, row, ball, best)
        elif moves_with_face(contact, tree, number, row):
            continue
        else:
            own = wave_of_face(waves, wave, row)
            if plane_row < 0 or not (
                same_plane(tree.numbers, row, plane_row) and same_sonotrode(waves, row, plane_row)
            ):
                # the ball met the last plane beside its faces
                if plane_row >= 0 and plane_delay < best:
                    last = wave_of_face(waves, wave, plane_row)
                    later, face = find_later_contact(
                        tree,
                        waves,
                        last,
                        profiles,
                        plane_row,
                        ball,
                        radius,
                        face_overlap,
                        time,
                        plane_delay,
                        best,
                    )
                    if face >= 0:
                        best, found = later, face
                plane_row = row
                plane_delay = vibrating_plane_delay(
                    tree.numbers, row, ball, radius, own, profiles, time, best
                )
            delay = plane_delay
            if delay <= best and not within_moved_borders(
                tree.numbers, row, ball, face_overlap, own, profiles, time, delay
            ):
                delay = NEVER
        if out_of_reach(contact, tree, number, ball.position, row):
            delay = NEVER
        if delay < best or (delay == best and (found < 0 or row < found)):
            best = delay
            found = row
    if plane_row >= 0 and plane_delay < best:  # the ball met the last plane beside its faces
        last = wave_of_face(waves, wave, plane_row)
        later, face = find_later_contact(
            tree,
            waves,
            last,
            profiles,
            plane_row,
            ball,
            radius,
            face_overlap,
            time,
            plane_delay,
            best,
        )
        if face >= 0:
            return later, face
    if found < 0:
        return NEVER, -1
    return best, found
