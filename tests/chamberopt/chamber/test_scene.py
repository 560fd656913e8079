"""The scene of a replica is reproducible, packed low, and has the sonotrode's speed scale."""

import math
from typing import get_args

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import balls_can_rest, build_scene, chamber_mesh, start_velocities
from chamberopt.common.errors import InputError
from chamberopt.design.effects import Effects, FrictionTable, SurfaceEffectTable
from chamberopt.design.load import load_design
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.design.shot import ShotSize
from sim_core import Drag, Rest, SurfaceEffects, TabulatedRestitution, TriangleMesh
from sim_core.effects.restitution import ELASTIC_BELOW
from tests.helpers.synthetic import DESIGNS, plate_design


@pytest.fixture(scope="module")
def design():
    return plate_design()


@pytest.fixture(scope="module")
def mesh(design):
    return chamber_mesh(build_chamber(design))


def test_seeds_do_not_move() -> None:
    # Written down once: another platform, another Python, another process must give the same.
    assert replica_seed(1, 0) == int.from_bytes(
        __import__("hashlib").sha256(b"chamberopt/search/1/0").digest()[:16], "big"
    )
    every = {
        replica_seed(s, r, stream)
        for s in (1, 2)
        for r in range(50)
        for stream in ("search", "confirm")
    }
    assert len(every) == 200
    with pytest.raises(ValueError, match="stream"):
        replica_seed(1, 0, "other")


def test_same_seed_same_scene(design, mesh) -> None:
    one, two, three = (build_scene(design, mesh, seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(one.balls.positions, two.balls.positions)
    np.testing.assert_array_equal(one.balls.velocities, two.balls.velocities)
    assert one.physics.vibration.phase == two.physics.vibration.phase
    assert (one.balls.positions != three.balls.positions).any()
    assert one.physics.vibration.phase != three.physics.vibration.phase


def test_what_the_design_says_is_in_the_scene(design, mesh) -> None:
    scene = build_scene(design, mesh, 1)
    assert len(scene.balls.positions) == design.shot.count
    assert scene.balls.diameter == design.shot.diameter
    assert scene.physics.vibration.tag == TAG_SONOTRODE
    assert scene.physics.vibration.amplitude == design.sonotrode.amplitude
    assert scene.record == (TAG_PART,)
    materials = design.materials
    by_tag = np.array(scene.physics.restitution.surfaces)
    expected = [(m.C0, m.v0_m_s) for m in (materials.part, materials.sonotrode, materials.wall)]
    np.testing.assert_array_equal(by_tag, expected)
    table = {"e_at_m_s": ((0.1, 0.9), (3.0, 0.5))}
    other = build_scene(design.changed({"materials.wall": table}), mesh, 1).physics.restitution
    assert other.surfaces[2] == TabulatedRestitution((0.1, 3.0), (0.9, 0.5))
    assert scene.physics.gravity is not None
    weightless = build_scene(
        design.model_copy(update={"effects": type(design.effects)(gravity=False)}), mesh, 1
    )
    assert weightless.physics.gravity is None


def test_friction_is_what_the_design_says_or_absent(design, mesh) -> None:
    def friction(**said):
        effects = design.effects.model_copy(update={"friction": FrictionTable(**said)})
        return build_scene(design.model_copy(update={"effects": effects}), mesh, 1).physics.friction

    smooth = design.changed({"effects.friction": "none", "effects.roughness": "none"})
    assert build_scene(smooth, mesh, 1).physics.friction is None
    assert friction(mu=0.3, beta0=0.2) == (((0.3, 0.2),) * 3, (0.3, 0.2))
    assert friction(mu=0.3, beta0=0.2, mu_balls=0.1, beta0_balls=-0.5) == (
        ((0.3, 0.2),) * 3,
        (0.1, -0.5),
    )
    own = {"mu_part": 0.1, "mu_sonotrode": 0.4, "mu_wall": 0.0}
    by_tag = dict(zip((TAG_PART, TAG_SONOTRODE, TAG_WALL), own.values(), strict=True))
    surfaces = friction(mu=0.3, beta0=0.2, **own).surfaces
    assert {tag: surfaces[tag] for tag in by_tag} == {k: (mu, 0.2) for k, mu in by_tag.items()}


def test_contact_mode_is_on_where_a_ball_can_lie_still(design, mesh) -> None:
    """Under a lid nothing but the sonotrode faces up; the design has the last word."""
    effects = type(design.effects)

    def physics(**said):
        return build_scene(design.model_copy(update={"effects": effects(**said)}), mesh, 1).physics

    assert physics().rest is None
    assert physics(rest=False).rest is None
    assert physics(rest=True).rest == Rest()
    gear = load_design(DESIGNS / "gear.toml")
    hung = chamber_mesh(build_chamber(gear))
    assert build_scene(gear, hung, 1).physics.rest == Rest()
    weightless = gear.model_copy(update={"effects": effects(gravity=False)})
    assert build_scene(weightless, hung, 1).physics.rest is None


def test_effects_that_are_asked_for_are_in_the_scene(design, mesh) -> None:
    """Each by its own key; none of them moves the random numbers of what was there before."""
    plain = build_scene(design, mesh, 1)
    assert plain.physics.random_phase is None
    assert plain.physics.drag is None
    assert plain.physics.ball_collisions is not None
    effects = design.effects.model_copy(update={"drag": True, "ball_collisions": False})
    sonotrode = design.sonotrode.model_copy(update={"motion": "random_phase"})
    asked = build_scene(
        design.model_copy(update={"effects": effects, "sonotrode": sonotrode}), mesh, 1
    )
    assert asked.physics.drag == Drag()
    assert asked.physics.ball_collisions is None
    other = build_scene(design.model_copy(update={"sonotrode": sonotrode}), mesh, 2)
    assert asked.physics.random_phase is not None
    assert asked.physics.random_phase != other.physics.random_phase
    np.testing.assert_array_equal(asked.balls.velocities, plain.balls.velocities)


def test_slopes_are_those_of_part_sonotrode_and_walls(design, mesh) -> None:
    rough = {"effects.roughness": {"slope_deg": 3.0, "part_deg": 5.0, "wall_deg": 0.0}}
    one, same, other = (build_scene(design.changed(rough), mesh, seed) for seed in (1, 1, 2))
    plain = build_scene(design.changed({"effects.roughness": "none"}), mesh, 1)
    assert plain.physics.roughness is None
    assert one.physics.roughness is not None
    slopes = dict(zip((TAG_PART, TAG_SONOTRODE, TAG_WALL), (5.0, 3.0, 0.0), strict=True))
    for tag, degrees in slopes.items():
        assert one.physics.roughness.surfaces[tag] == math.tan(math.radians(degrees))
    assert one.physics.roughness == same.physics.roughness
    assert one.physics.roughness != other.physics.roughness
    np.testing.assert_array_equal(one.balls.velocities, plain.balls.velocities)


def test_numerical_tolerances_are_what_the_design_says(design, mesh) -> None:
    """Their defaults are the simulator's own, to the last bit."""
    drag = design.model_copy(update={"effects": design.effects.model_copy(update={"drag": True})})
    plain = build_scene(drag, mesh, 1).physics
    assert plain.restitution.elastic_below == ELASTIC_BELOW
    assert plain.drag == Drag()
    finer = {"process.accuracy.elastic_below_mm_s": 2.0, "process.accuracy.drag_step_ms": 5.0}
    asked = build_scene(drag.changed(finer), mesh, 1).physics
    assert asked.restitution.elastic_below == pytest.approx(2e-3)
    assert asked.drag == Drag(piece=5e-3)


def test_a_mix_of_sizes_is_in_the_scene(design, mesh) -> None:
    sizes = (ShotSize(diameter_mm=2.0, share=0.4), ShotSize(diameter_mm=3.0, share=0.6))
    shot = design.shot.model_copy(update={"diameter_mm": None, "mix": sizes})
    mixed = build_scene(design.model_copy(update={"shot": shot}), mesh, 1)
    np.testing.assert_array_equal(mixed.balls.diameters, shot.diameters)
    assert mixed.balls.masses.sum() == pytest.approx(design.shot.mass, rel=0.02)
    assert mixed.physics.rest is None


@pytest.mark.parametrize("rest", [None, True, False])
def test_a_mix_rests_where_balls_of_one_size_do(design, mesh, rest: bool | None) -> None:
    """On a floor that does not vibrate, unless effects.rest says otherwise."""
    still = TriangleMesh(mesh.vertices, mesh.triangles, np.full_like(mesh.tags, TAG_WALL))
    sizes = [{"diameter_mm": 2.0, "share": 0.4}, {"diameter_mm": 3.0, "share": 0.6}]
    one = design.changed({"effects.rest": rest})
    mixed = one.changed({"shot.diameter_mm": None, "shot.mix": sizes})
    for room in (mesh, still):
        expected = room is still if rest is None else rest
        assert balls_can_rest(one, room) == balls_can_rest(mixed, room) == expected


def test_start_velocities_are_isotropic_maxwell() -> None:
    # Isotropic, rms speed V: every component has variance V²/3 and kurtosis 3.
    v = start_velocities(np.random.default_rng(0), 200_000, 3.0)
    np.testing.assert_allclose((v**2).mean(axis=0), 3.0, rtol=0.02)
    np.testing.assert_allclose((v**4).mean(axis=0) / (v**2).mean(axis=0) ** 2, 3.0, rtol=0.03)
    np.testing.assert_allclose(v.mean(axis=0), 0.0, atol=0.02)


@pytest.mark.parametrize(
    ("shot", "said"),
    [
        ({"mass_g": 100.0}, r"shot: only \d+ of 907 balls .* find a free place.*shot\.mass_g"),
        ({"diameter_mm": 0.1}, "supported"),
    ],
)
def test_shot_that_cannot_be_placed_is_refused_by_its_fields(shot: dict, said: str) -> None:
    crowded = plate_design(**{f"shot__{name}": value for name, value in shot.items()})
    with pytest.raises(InputError, match=said):
        build_scene(crowded, chamber_mesh(build_chamber(crowded)), 1)


def test_each_table_of_a_surface_effect_has_its_effect_in_the_simulator() -> None:
    tables = {
        name
        for name, field in Effects.model_fields.items()
        for table in get_args(field.annotation)
        if isinstance(table, type) and issubclass(table, SurfaceEffectTable)
    }
    assert tables == set(SurfaceEffects._fields)
