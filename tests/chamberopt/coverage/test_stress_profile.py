"""Figures of the compressed layer over surfaces of which they are known."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.field.target_field import TargetField, WindowSetting, find_target_field
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.strength import LEVELS
from chamberopt.coverage.strength_intervals import StrengthHistograms
from chamberopt.coverage.stress_knowledge import (
    BANDS,
    DEPTH,
    OF_STRESS,
    PEAK,
    PEAK_DEPTH,
    SURFACE,
    arc_by_law,
    edge_notes,
    stress_bands,
    stress_notes,
    why_not_known,
)
from chamberopt.coverage.stress_law import OF_DENT, eigenstrain_under_dents, residual_stress
from chamberopt.coverage.stress_model import StressModel, stress_model
from chamberopt.coverage.stress_profile import (
    LayerHistograms,
    dented_by_size,
    layer_estimates,
    layer_histograms,
    level_layers,
    lowest,
    stress_estimates,
    surface_profile,
)
from chamberopt.design.load import Design
from tests.helpers.synthetic import (
    chamber_round,
    dents_at,
    machine_values,
    plane_chamber,
    plate_design,
    triangles_at,
)

PLANE = plane_chamber()
PART = {"alloy": "7075-T6"}
SIZE = 0.2e-3
STRENGTH = Estimate(30.0, 1.0)
GLASS_ON = {"C0": 0.9, "v0_m_s": 0.3}


def asked(**stress: object) -> Design:
    """A plate of 7075-T6 whose residual stress is asked for."""
    return plate_design().changed({"materials.part": PART, "stress": stress})


DESIGN = asked()


def model_of(design: Design = DESIGN) -> StressModel:
    model = stress_model(design)
    assert model is not None
    return model


@cache
def plane_field() -> TargetField:
    setting = WindowSetting(1e-6, 20_000, 3e-3, 1e-3)
    return find_target_field(PLANE, chamber_mesh(PLANE), setting)


def plane_dents(rng: np.random.Generator, per_mm2: float, diameter: np.ndarray) -> Hits:
    count = rng.poisson(per_mm2 * 225.0)
    place = np.column_stack([rng.uniform(-7.499e-3, 7.499e-3, (count, 2)), np.zeros(count)])
    return dents_at(DESIGN, triangles_at(PLANE, place), place, rng.choice(diameter, count))


def batches_of(seed: int, per_mm2: float, diameter: float = SIZE) -> list[list[Hits]]:
    rng = np.random.default_rng(seed)
    return [[plane_dents(rng, per_mm2, np.array([diameter]))] for _ in range(8)]


def test_the_layer_of_equal_dents_grows_as_their_coverage() -> None:
    """z = 1.25 d (1 - exp(-L t)), and the stress in a thick part with it."""
    batches, model = batches_of(11, 7.5), model_of()
    rate = 60.0e6 * np.pi / 4.0 * SIZE**2  # dented area over area, in 8 s
    seen = layer_histograms(plane_field(), batches, 1.0, model)
    speed, depth = model.speeds(np.array([SIZE]), model.balls[0]), np.linspace(0.0, 3e-4, 1001)
    strain = eigenstrain_under_dents(
        depth, np.array([SIZE]), speed, (model.balls[0], model.density), model.metal
    )
    full = 1e-6 * residual_stress(depth, strain[0], model.metal)
    for time in (8.0, 80.0):
        found, covered = layer_estimates(seen, time), -np.expm1(-rate * time / 8.0)
        assert found[DEPTH].value == pytest.approx(1e6 * OF_DENT * SIZE * covered, rel=0.03)
        assert found[SURFACE].value == pytest.approx(full[0] * covered, rel=0.03)
        assert found[PEAK].value == pytest.approx(full.min() * covered, rel=0.03)
        assert found[PEAK_DEPTH].value == pytest.approx(1e6 * depth[full.argmin()], rel=0.03)
        for one in found.values():
            assert one.half_width < 0.05 * abs(one.value)  # the band of the law is not in it


def test_two_sizes_of_dents_leave_the_layer_of_the_wider_where_it_fell() -> None:
    """e = (1 - exp(-L1 t)) (e1 - e2) + (1 - exp(-(L1 + L2) t)) e2 for levels with L1, L2."""
    model = model_of()
    rates = np.zeros(LEVELS)
    rates[7], rates[31] = 0.5, 0.8
    parts = np.tile(rates / 8, (8, 4, 1))
    found = StrengthHistograms(parts, np.ones(8), SIZE)
    layers = level_layers(model, SIZE, np.ones((1, LEVELS)))
    profile = surface_profile(LayerHistograms(found, layers), 8.0)
    assert profile is not None
    wide, narrow = (
        eigenstrain_under_dents(
            layers.depth, np.array([size]), model.speeds(np.array([size]), model.balls[0]),
            (model.balls[0], model.density), model.metal,
        )[0]
        for size in (SIZE * 31.5 / 32.0, SIZE * 7.5 / 32.0)
    )  # fmt: skip
    exact = -np.expm1(-0.8) * (wide - narrow) - np.expm1(-1.3) * narrow
    assert profile.eigenstrain == pytest.approx(exact, abs=0.03 * exact.max())
    assert profile.half_width_MPa == pytest.approx(0.0, abs=1e-9)


def test_balls_of_two_sizes_have_a_mean_layer_by_dented_area() -> None:
    mixed = DESIGN.changed(
        {"shot.diameter_mm": None, "shot.mix": [{"diameter_mm": 2.0, "share": 0.5},
                                                {"diameter_mm": 3.0, "share": 0.5}]}
    )  # fmt: skip
    model, one = model_of(mixed), np.ones((2, LEVELS))
    alone = [level_layers(model, SIZE, one * np.array([[x], [1.0 - x]])) for x in (1.0, 0.0)]
    both = level_layers(model, SIZE, one * np.array([[0.25], [0.75]]))
    parts = 0.25 * alone[0].eigenstrain + 0.75 * alone[1].eigenstrain
    assert both.eigenstrain == pytest.approx(parts)
    hits = batches_of(1, 1.0)
    sizes = dented_by_size(hits, SIZE, model)
    area = sum(np.pi / 4.0 * (one.dent.astype(float) ** 2).sum() for (one,) in hits)
    assert sizes.sum() == pytest.approx(area)
    assert sizes[1].sum() == pytest.approx(area)  # dents_at are of the largest balls


@pytest.mark.parametrize("dents", [20.0, 200.0])
def test_intervals_hold_by_the_scatter_of_replicas(dents: float) -> None:
    """100 surfaces of 60 windows with a broad law of dent size; each figure is known."""
    rng, model = np.random.default_rng(5), model_of()
    law = np.linspace(1.0, 0.0, LEVELS) ** 2 * np.linspace(0.0, 1.0, LEVELS)
    law *= dents / law.sum()
    size = 5.0 / dents * (np.arange(1, LEVELS + 1) / LEVELS) ** 2  # of one dent over the window
    layers = level_layers(model, SIZE, np.ones((1, LEVELS)))

    def figures(counts: np.ndarray) -> dict[str, Any]:
        found = StrengthHistograms(counts * size, np.ones(len(counts)), SIZE)
        return layer_estimates(LayerHistograms(found, layers), float(len(counts)))

    true = figures(np.tile(law / 8, (8, 1, 1)))
    held = dict.fromkeys(true, 0)
    for _ in range(100):
        found = figures(rng.poisson(law / 8, (8, 60, LEVELS)))
        for name, one in found.items():
            held[name] += one.low <= true[name].value <= one.high
    assert min(held.values()) >= 90, held


def test_the_lowest_point_of_a_parabola_lies_between_the_depths() -> None:
    depth = np.linspace(0.0, 1.0, 11)
    assert lowest(depth, 3.0 * (depth - 0.33) ** 2 - 5.0) == pytest.approx((0.33, -5.0))
    assert lowest(depth, depth) == (0.0, 0.0)


def test_what_the_law_does_not_tell_is_said_in_words() -> None:
    found = {"mean_coverage": layer_of(batches_of(1, 40.0))[DEPTH].times(1e-9)}
    few = stress_estimates(plane_field(), batches_of(1, 40.0), DESIGN, found)
    assert few[SURFACE].in_words == "coverage below 98 %"
    assert not few[DEPTH].in_words
    full = {"mean_coverage": few[DEPTH].times(0.99 / few[DEPTH].value)}
    assert not stress_estimates(plane_field(), batches_of(1, 40.0), DESIGN, full)[PEAK].in_words
    wide = stress_estimates(plane_field(), batches_of(1, 4.0, 1.3e-3), DESIGN, full)
    assert wide[PEAK].in_words == "dents too wide for the law"
    thin = stress_estimates(plane_field(), batches_of(1, 40.0), asked(thickness_mm=0.5), full)
    assert thin[PEAK_DEPTH].in_words == "plate too thin for the law"
    half = {"mean_coverage": few[DEPTH].times(0.5 / few[DEPTH].value)}
    assert why_not_known(half | few, 0.5, SIZE, model_of()) == ""
    assert why_not_known(half | few, 0.6, SIZE, model_of()) == "coverage below 98 %"
    hidden = plate_design().changed({"materials.part": PART})
    assert set(stress_estimates(plane_field(), batches_of(1, 40.0), hidden, full)) == {DEPTH}


def layer_of(batches: list[list[Hits]], design: Design = DESIGN) -> dict[str, Any]:
    return layer_estimates(layer_histograms(plane_field(), batches, 1.0, stress_model(design)), 8.0)


def test_a_free_plate_peened_on_one_side_is_less_compressed() -> None:
    batches = batches_of(3, 40.0)
    peaks = [layer_of(batches, one)[PEAK].value
             for one in (asked(thickness_mm=2), asked(thickness_mm=2, peened="held_flat"),
                         asked(thickness_mm=20), DESIGN)]  # fmt: skip
    assert peaks == sorted(peaks, reverse=True)
    assert peaks[2] == pytest.approx(peaks[3], rel=0.06)


def test_bands_are_kept_apart_and_belong_to_what_is_asked_for() -> None:
    assert stress_bands(DESIGN) == BANDS
    assert set(BANDS) == {DEPTH, *OF_STRESS}
    assert set(stress_bands(plate_design())) == {DEPTH}
    assert stress_bands(plate_design().changed({"materials.part": {"alloy": "316L"}})) == {}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"materials.part": {"alloy": "18CrNiMo7-6"}}, r"part\.alloy: 18CrNiMo7-6 is case-harden"),
        ({"materials.part": {"alloy": "316L"}}, r"tensile_MPa: given 560, more than 1\.6 times"),
        ({"materials.part": {"alloy": "100Cr6"}}, r"yield_MPa: missing; \[stress\] takes yield"),
        ({"materials.part": {**PART, "hardness_HB": 700}}, r"given 700, harder than the balls"),
        (
            {
                "shot.material": "glass",
                **{f"materials.{name}": GLASS_ON for name in ("wall", "shot", "sonotrode")},
                "materials.part": {**PART, "v0_m_s": 0.3},
            },
            "the hardness of glass is not known",
        ),
        ({"materials.part": {"C0": 0.91, "v0_m_s": 0.2, "hardness_HB": 150, "yield_MPa": 500.0,
                             "tensile_MPa": 570.0}}, "the elasticity of part or balls is not"),
        ({"stress": {"peened": "both_sides"}}, r'stress\.peened: given "both_sides" without thick'),
    ],
)  # fmt: skip
def test_a_stress_that_cannot_be_estimated_is_refused(
    changes: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        DESIGN.changed(changes)


@pytest.mark.parametrize(
    ("ball_mm", "strength_um", "arc_mm"),
    [(3.0, 20.3, 0.290), (3.0, 31.8, 0.349), (3.0, 48.3, 0.406), (1.5, 16.0, 0.204)],
)
def test_a_strip_bends_as_a_whole_simulation_has_it(
    ball_mm: float, strength_um: float, arc_mm: float
) -> None:
    """Arcs of a simulated chamber's dents, all sizes of them, by another program: 10 % above."""
    design = DESIGN.changed({"shot.diameter_mm": ball_mm})
    assert 1e3 * arc_by_law(design, 1e-6 * strength_um) == pytest.approx(arc_mm, rel=0.1)


TOLD = {"strength_um": STRENGTH, DEPTH: Estimate(250.0, 1.0)} | dict.fromkeys(
    OF_STRESS, Estimate(-300.0, 1.0)
)


def test_strips_that_disagree_with_the_law_are_told() -> None:
    """K is 10 mm of arc for 1 mm of strength by the law."""
    values = {**machine_values(K=0.03, beta=0.1)}

    def notes(k: float) -> tuple[str, ...]:
        machine = {**values, "log_mean": (np.log(k), 0.0)}
        return stress_notes(DESIGN.changed({"calibration": machine}), TOLD)

    assert len(notes(10.0)) == len(notes(15.0)) == 1
    for k in (4.0, 25.0):
        assert "bends an A strip by 0.32 mm, and the calibration has" in notes(k)[0]


def test_the_strip_along_sharp_edges_is_told() -> None:
    """A face of 20 mm x 20 mm has four strips of .5 mm; a ball has no edges."""
    depth = {
        "compression_depth_um": Estimate(250.0, 1.0),
        "low.compression_depth_um": Estimate(0.0, 1.0),
    }
    slab = trimesh.creation.box((0.02, 0.02, 2e-3)).subdivide()
    top = slab.triangles_center[:, 2] > 0.9e-3
    part = chamber_round(slab, top).part
    (note,) = edge_notes(DESIGN, replace(part, zones={"low": ~top}), depth)
    assert note.startswith("10 % of the target are within 2 depths of compression of a sharp edge")
    assert edge_notes(plate_design(), part, depth) == ()
    ball = trimesh.creation.icosphere(3, 0.01)
    assert edge_notes(DESIGN, chamber_round(ball).part, depth) == ()


def test_a_metal_that_hardens_strongly_gets_no_depth() -> None:
    """Tensile over yield strength of 316L is 2, of a quenched steel 1.1."""
    plain = plate_design()
    assert len(stress_notes(plain, TOLD)) == 1
    assert "depth of compression in a thick part by a factor of 1.6" in stress_notes(plain, TOLD)[0]
    assert not plain.materials.part.hardens_strongly
    hard = plain.changed({"materials.part.tensile_MPa": 1000.0})
    both = hard.changed({"materials.part.yield_MPa": 900.0})
    assert stress_notes(hard, TOLD) == stress_notes(both, TOLD)
    assert "500 to 700 MPa" in stress_notes(hard, TOLD)[1]
    soft = hard.changed({"materials.part.yield_MPa": 290.0})
    assert soft.materials.part.hardens_strongly
    assert "cannot be estimated" in stress_notes(soft, TOLD)[1]
    assert "residual stress at the surface by a factor of 1.9" in stress_notes(DESIGN, TOLD)[0]
    assert len(stress_notes(DESIGN, TOLD)) == 1
    thin = {**TOLD, "surface_stress_MPa": Estimate(-300.0, 1.0).not_known("plate too thin")}
    assert "stress at the surface" not in stress_notes(DESIGN, thin)[0]
    assert "depth of compression" in stress_notes(DESIGN, thin)[0]
