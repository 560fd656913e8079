"""Scenes in files: a failure is saved as one and becomes a permanent regression test.

An .npz: ``vertices``, ``triangles``, ``tags``, ``positions``, ``velocities``, ``numbers``
(diameter, density, duration, warm-up), ``spins`` if there are any, ``each`` (n, 2), diameter and
density of each ball, where they differ, and ``physics``, the effects as JSON, field by field;
absent ones are null.
"""

import json
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np

from sim_core import AmplitudeProfile, Balls, Physics, Scene, TriangleMesh

FOLDER = Path(__file__).parent / "saved"
# Names in files saved before they were renamed.
RENAMED = {"turn": "part_rotation", "swing": "amplitude"}


def save_scene(path: Path, scene: Scene) -> None:
    """Writes the scene, to the last bit."""
    balls = scene.balls
    more = {} if balls.spins is None else {"spins": balls.spins}
    if not balls.alike:
        more["each"] = np.column_stack([balls.diameters, balls.densities])
    effects = {name: _plain(effect) for name, effect in scene.physics._asdict().items()}
    np.savez_compressed(
        path,
        vertices=scene.mesh.vertices,
        triangles=scene.mesh.triangles,
        tags=scene.mesh.tags,
        positions=balls.positions,
        velocities=balls.velocities,
        numbers=np.array([balls.diameters[0], balls.densities[0], scene.duration, scene.warmup]),
        physics=np.array(json.dumps(effects)),
        **more,
    )


def load_scene(path: Path) -> Scene:
    """The scene again; fields of effects that were added since have their defaults."""
    with np.load(path) as file:
        diameter, density, duration, warmup = (float(number) for number in file["numbers"])
        effects = json.loads(str(file["physics"]))
        kinds = get_type_hints(Physics)
        physics = Physics(
            **{
                RENAMED.get(name, name): _effect(kinds[RENAMED.get(name, name)], numbers)
                for name, numbers in effects.items()
                if name != "surface" or numbers is not None  # no value of it, once saved
            }
        )
        mesh = TriangleMesh(file["vertices"], file["triangles"], file["tags"])
        sizes = file["each"].T if "each" in file else (diameter, density)
        balls = Balls(file["positions"], file["velocities"], *sizes, file.get("spins"))
    return Scene(mesh, balls, physics, duration, warmup)


def _plain(value: Any) -> Any:
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _effect(hint: Any, numbers: dict[str, Any] | list[dict[str, Any]] | None) -> Any:
    if numbers is None:
        return None
    if isinstance(numbers, list):
        return tuple(_effect(hint, one) for one in numbers)
    kind = next(one for one in (*get_args(hint), hint) if hasattr(one, "_fields"))
    return kind(**{RENAMED.get(name, name): _tuples(value) for name, value in numbers.items()})


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):  # the only effect within an effect
        return AmplitudeProfile(**{name: _tuples(part) for name, part in value.items()})
    return tuple(_tuples(part) for part in value) if isinstance(value, list) else value
