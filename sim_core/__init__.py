"""sim_core: exact event-driven dynamics of balls in a closed triangle mesh, or a cavity of exact surfaces.

Build a Scene from a TriangleMesh (or a cylinder_cavity or prism_cavity), Balls and Physics, then simulate it. SI units
throughout.
"""

from sim_core.balls import Balls
from sim_core.contact.resting_balls import Resting, can_rest
from sim_core.effects.ball_collisions import BallCollisions
from sim_core.effects.contact_mode import Rest
from sim_core.effects.drag import Drag, drag_coefficient
from sim_core.effects.friction import Friction
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import Turn
from sim_core.effects.random_phase import RandomPhase
from sim_core.effects.restitution import Restitution, restitution_at
from sim_core.effects.vibration import Vibration
from sim_core.errors import SceneError, SimulationError
from sim_core.geometry.analytic import AnalyticCavity, cylinder_cavity, prism_cavity
from sim_core.geometry.closest_point import Nearest, nearest
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.triangle_lookup import triangles_at
from sim_core.loop.compile_ahead import compile_simulator, is_compiled
from sim_core.loop.impact_log import ImpactLog
from sim_core.loop.simulate import Collisions, Result, simulate
from sim_core.scene.packing import pack_balls
from sim_core.scene.physics import Physics
from sim_core.scene.scene import Scene, require_free_turn

__all__ = [
    "AnalyticCavity",
    "BallCollisions",
    "Balls",
    "Collisions",
    "Drag",
    "Friction",
    "Gravity",
    "ImpactLog",
    "Nearest",
    "Physics",
    "RandomPhase",
    "Rest",
    "Resting",
    "Restitution",
    "Result",
    "Scene",
    "SceneError",
    "SimulationError",
    "TriangleMesh",
    "Turn",
    "Vibration",
    "can_rest",
    "compile_simulator",
    "cylinder_cavity",
    "drag_coefficient",
    "is_compiled",
    "nearest",
    "pack_balls",
    "prism_cavity",
    "require_free_turn",
    "restitution_at",
    "simulate",
    "triangles_at",
]
