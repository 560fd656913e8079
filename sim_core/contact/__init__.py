"""Contact mode: balls that slide, roll or lie still on surfaces and on one another.

**Why.** A ball that bounces on a still surface and loses speed at every bounce bounces infinitely
often in finite time. A simulator that goes from event to event would not get past that time.

**How a ball moves.** Every ball is in one of four modes:

========  =====================================================  =================================
mode      the ball                                               it ends when
========  =====================================================  =================================
FLYING    is in free flight                                      a slow hit captures it
SLIDING   slides or rolls on its supports, along a parabola      it leaves its last support, comes
                                                                 to rest, or is hit
ASLEEP    lies still on its supports                             a fast hit, the turning part, or
                                                                 something under it moves it
JAMMED    is held where it is, between the balls around it       one of these balls has gone
========  =====================================================  =================================

**Capture.** A hit slower than ``Rest.capture`` on a still surface into which gravity presses is
plastic: the ball keeps the normal n of the surface as a *support*. From then on its velocity and
acceleration are the projections of the free ones on the cone {x: n_k x >= 0} of all its supports
(the constrained acceleration is the one nearest to the free one: J. J. Moreau, J. Math. Pures
Appl. 56 (1977) 65), so the path is again a parabola, with an acceleration of its own. A capture
neglects less than capture²/2 of energy per mass.

**Slowing down.** ``Rest.resistance`` slows a ball in contact by that share of the load on its
supports. Without Friction this is sliding friction; with Friction the ball spins, Coulomb's law
decides whether it rolls or slips, and the resistance is that against rolling.

**What moves supports no ball,** unless ``Rest.on_vibrating`` is True: then a ball sticks to a
vibrating face, and moves with it, for as long as the face presses it. Balls on such a ball hop.
Otherwise nothing rests on a vibrating surface, and never on a turning part: hits there keep their
law. The turning part moves what it touches, however slowly, and what it presses moves balls that
lie still in its way.

**Balls on balls.** A ball that lies still is itself a still surface for hits slower than
``Restitution.elastic_below``, as if friction held it, so heaps come to rest from below. Two
balls that lean on each other while they move go on in small hops. A ball that has made many hops
without getting anywhere is held where it is (JAMMED); if it is held at one place again, then for
twice as long each time. A faster hit wakes a ball, and with it those that stand on it.

**Files**

- ``effects/contact_mode.py``: the options (Rest) and the state of all balls (ContactState).
- ``supports.py``: supports of a ball, the projection on their cone, the list of balls in contact.
- ``landing_and_lift_off.py``: capture by a surface, and which supports a ball keeps as it moves on.
- ``riding.py``: a ball sticks to a vibrating face, moves with it, and is let go.
- ``rolling_friction.py``: velocity and acceleration on supports, with resistance and friction.
- ``path_end.py``: when a path in contact ends: at the border of a face, off an edge, at a stop.
- ``ball_on_ball.py``: two balls meet, at least one of them not in free flight.
- ``pushed_by_part.py``: the turning part moves what it touches and what it presses.
- ``jamming.py``: small hops that lead nowhere, and balls that are held.
- ``resting_balls.py``: where balls can lie still, and which ones do at the end.
- ``loop/contact_neighbours.py``: pairs with a ball in contact, and waking a ball's neighbours.

Normals and velocities are projected per unit mass throughout; all balls of a scene with contact
mode are equal.
"""
