"""Contact mode: balls that slide, roll or lie still on surfaces and on one another.

**Why.** A ball that bounces on a still surface and loses speed at every bounce bounces infinitely
often in finite time. A simulator that goes from event to event would not get past that time.

**How a ball moves.** Every ball is in one of four modes:

========  =====================================================  =================================
mode      the ball                                               the mode ends when
========  =====================================================  =================================
FLYING    is in free flight                                      a slow hit captures it
SLIDING   slides or rolls on its supports, along a parabola      it leaves its last support, comes
                                                                 to rest, or is hit
ASLEEP    lies still on its supports                             a fast hit, the turning part, or
                                                                 something under it moves it
JAMMED    is held where it is, between the balls around it       one of these balls has gone
========  =====================================================  =================================

**Capture.** A hit slower than ``Rest.capture`` on a still surface into which gravity presses is
plastic: the ball keeps the normal n of the surface as a *support*. From then on the
ball's velocity and acceleration are projected onto the cone {x: n_k x >= 0} of all its supports.
The projected acceleration is the vector of the cone nearest to the free acceleration (J. J. Moreau,
J. Math. Pures Appl. 56 (1977) 65). The path is therefore again a parabola, with the ball's own
acceleration. A capture neglects less than capture²/2 of energy per mass.

**Slowing down.** A ball in contact decelerates by ``Rest.resistance`` times the load on its
supports. Without Friction this is sliding friction. With Friction the ball spins, Coulomb's law
decides between rolling and slipping, and the resistance acts against rolling.

**Moving surfaces support no ball,** unless ``Rest.on_vibrating`` is True. Then a ball sticks to a
vibrating face, and moves with it, for as long as the face presses the ball. Balls that lie on
this ball hop. Otherwise no ball rests on a vibrating surface. No ball ever rests on a turning part:
hits there lose speed as restitution says. The turning part moves every ball that it touches, even
in the slowest hit. A ball that the part presses moves still balls in its way.

**Balls on balls.** A ball that lies still acts as a still surface for hits slower than
``Restitution.elastic_below``, as if friction held it. Heaps therefore come to rest from below. Two
balls that lean on each other while they move go on in small hops. A ball that has made many hops
without getting anywhere is held where it is (JAMMED). Each further jam at the same place holds it
twice as long. A faster hit wakes a ball and the balls that stand on it.

**Files**

- ``effects/contact_mode.py``: the options (Rest) and the state of all balls (ContactState).
- ``supports.py``: supports of a ball, the projection on their cone, the list of balls in contact.
- ``landing_and_lift_off.py``: capture by a surface, and the supports that a moving ball keeps.
- ``cylinder_wall.py``: balls that hop along the wall of an exact cylinder, or lean on it.
- ``riding.py``: balls that stick to a vibrating face, move with it, and are let go.
- ``rolling_friction.py``: velocity and acceleration on supports, with resistance and friction.
- ``path_end.py``: end of a path in contact: at the border of a face, off an edge, at a stop.
- ``ball_on_ball.py``: collision of two balls of which at least one is in contact mode.
- ``pushed_by_part.py``: pushes by the turning part.
- ``jamming.py``: small hops that lead nowhere, and balls that are held.
- ``resting_balls.py``: balls that lie still at the end.
- ``loop/contact_neighbours.py``: pairs with a ball in contact, and waking a ball's neighbours.

Impulses and forces are per unit mass of the ball on which they act. Balls may have several sizes
and masses (``effects/ball_sizes.py``). In slow hits a ball that lies still is a surface also for a
ball that is much heavier.
"""
