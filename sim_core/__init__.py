"""sim_core: exact event-driven dynamics of balls in a closed cavity.

Build a Scene from a TriangleMesh (or a cylinder_cavity, prism_cavity or periodic_box), Balls and
Physics, then simulate it. All quantities are in SI units.

Example: steel balls in a box whose floor vibrates, with the impacts on the ceiling recorded.

    >>> import numpy as np
    >>> FLOOR, CEILING, WALLS = 0, 1, 2
    >>> square = np.array([[0.0, 0.0], [0.03, 0.0], [0.03, 0.03], [0.0, 0.03]])
    >>> box = prism_cavity(square, bottom=0.0, top=0.05, tags=[FLOOR, CEILING, WALLS])
    >>> rng = np.random.default_rng(seed=1)
    >>> positions = pack_balls(box, 20, diameter=0.003, rng=rng, clear=1e-4)
    >>> balls = Balls(positions, np.zeros((20, 3)), diameter=0.003, density=7800.0)
    >>> steel = (0.9, 1.0)
    >>> physics = Physics(
    ...     gravity=Gravity(),
    ...     restitution=Restitution(surfaces=[steel] * 3, balls=steel),
    ...     vibration=Vibration(tag=FLOOR, amplitude=50e-6, frequency=20e3),
    ... )
    >>> scene = Scene(box, balls, physics, duration=0.5, warmup=0.5, record=[CEILING])
    >>> impacts = simulate(scene).impacts
    >>> len(impacts.normal_speed) > 100, impacts.position.shape[1]
    (True, 3)
"""

from sim_core.balls import Balls
from sim_core.contact.resting_balls import Resting, can_rest
from sim_core.effects.amplitude_profile import rms_share
from sim_core.effects.contact_mode import Rest
from sim_core.effects.drag import Drag, drag_coefficient
from sim_core.effects.flexure import Flexure, plate_mobility, zener_parameter, zener_restitution
from sim_core.effects.friction import Friction
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import PartRotation
from sim_core.effects.random_phase import RandomPhase
from sim_core.effects.restitution import (
    Restitution,
    RestitutionLaw,
    TabulatedRestitution,
    restitution_at,
)
from sim_core.effects.roughness import Roughness
from sim_core.effects.surface.surface_effects import SurfaceEffects, surface_effects
from sim_core.effects.vibration import AmplitudeProfile, Vibration
from sim_core.errors import SceneError, SimulationError
from sim_core.geometry.analytic import AnalyticCavity, cylinder_cavity, periodic_box, prism_cavity
from sim_core.geometry.closest_point import ClosestPoints, closest_on_each, closest_points
from sim_core.geometry.largest_ball import largest_balls
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.ray_length import ray_lengths
from sim_core.geometry.sonotrode_border import largest_amplitude
from sim_core.geometry.triangle_lookup import find_triangles
from sim_core.loop.compile_ahead import compile_simulator, is_compiled
from sim_core.loop.impact_log import CollisionLog, ImpactLog
from sim_core.loop.simulate import Collisions, SimulationResult, simulate
from sim_core.loop.stays import Trapped
from sim_core.numerics.computed_once import computed_once
from sim_core.numerics.jit import jit, user_cache
from sim_core.scene.bent_faces import require_profiles
from sim_core.scene.frames import Energies, Frames, energies
from sim_core.scene.packing import pack_balls
from sim_core.scene.physics import BallCollisions, Physics
from sim_core.scene.scene import Scene, require_free_rotation

__all__ = [
    "AmplitudeProfile",
    "AnalyticCavity",
    "BallCollisions",
    "Balls",
    "ClosestPoints",
    "CollisionLog",
    "Collisions",
    "Drag",
    "Energies",
    "Flexure",
    "Frames",
    "Friction",
    "Gravity",
    "ImpactLog",
    "PartRotation",
    "Physics",
    "RandomPhase",
    "Rest",
    "Resting",
    "Restitution",
    "RestitutionLaw",
    "Roughness",
    "Scene",
    "SceneError",
    "SimulationError",
    "SimulationResult",
    "SurfaceEffects",
    "TabulatedRestitution",
    "Trapped",
    "TriangleMesh",
    "Vibration",
    "can_rest",
    "closest_on_each",
    "closest_points",
    "compile_simulator",
    "computed_once",
    "cylinder_cavity",
    "drag_coefficient",
    "energies",
    "find_triangles",
    "is_compiled",
    "jit",
    "largest_amplitude",
    "largest_balls",
    "pack_balls",
    "periodic_box",
    "plate_mobility",
    "prism_cavity",
    "ray_lengths",
    "require_free_rotation",
    "require_profiles",
    "restitution_at",
    "rms_share",
    "simulate",
    "surface_effects",
    "user_cache",
    "zener_parameter",
    "zener_restitution",
]
