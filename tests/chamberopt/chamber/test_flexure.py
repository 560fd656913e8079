"""Where flexure of a part is simulated, how soft the part is there, and what is said of it."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.flexure import (
    flexure_facts,
    flexure_of_surfaces,
    mean_softness,
    softness_of_part,
)
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design
from chamberopt.design.flexure import plate_metals
from chamberopt.design.load import load_design
from chamberopt.design.shape_surface import TAG_PART
from sim_core import plate_mobility, zener_parameter, zener_restitution
from tests.helpers.synthetic import DESIGNS, plate_design

TITANIUM = {"part_E_GPa": 113.8, "part_poisson": 0.342, "part_density_kg_m3": 4430}
STEEL = {"shot_E_GPa": 210, "shot_poisson": 0.3}


@pytest.fixture(scope="module")
def blade() -> Design:
    return load_design(DESIGNS / "blade.toml")


@pytest.fixture(scope="module")
def chamber(blade: Design) -> Chamber:
    return build_chamber(blade)


def thin_notes(chamber: Chamber) -> list[str]:
    return [note for note in chamber.notes if "flexure" in note]


def test_a_blade_is_thin_by_itself(blade: Design, chamber: Chamber) -> None:
    """The blade is drawn 0.5 to 3 mm thick; its root block and the walls are rigid."""
    thickness = chamber.part.thickness
    assert thickness is not None
    thin = np.isfinite(thickness)
    area = chamber.part.area
    assert area[thin & chamber.part.target].sum() > 0.9 * area[chamber.part.target].sum()
    assert thickness[thin & chamber.part.target].min() > 0.3e-3
    assert np.median(thickness[thin & chamber.part.target]) < 3e-3
    assert not thin[
        chamber.part.vertices[chamber.part.triangles][:, :, 2].min(axis=1) > 0.0585
    ].any()
    (note,) = thin_notes(chamber)
    assert note.startswith("the target gives way under the balls (thinnest 0.")
    facts = flexure_facts(blade, chamber)["flexure"]
    assert facts["lowers_restitution_on_share"] > 0.9  # type: ignore[operator]
    assert 0.5 < facts["restitution_times"] < 0.98  # type: ignore[operator]


def test_the_scene_has_the_mobility_of_each_triangle(blade: Design, chamber: Chamber) -> None:
    mesh = chamber_mesh(chamber)
    flexure = flexure_of_surfaces(blade, chamber, mesh)
    assert flexure is not None
    scene = build_scene(blade, mesh, 1, flexure=flexure)
    assert scene.physics.flexure is flexure
    assert not flexure.mobility[mesh.tags != TAG_PART].any()
    part = 113.8e9 / (1.0 - 0.342**2)
    steel = 210e9 / (1.0 - 0.3**2)
    assert flexure.modulus == pytest.approx(1.0 / (1.0 / part + 1.0 / steel))
    thickness, own = chamber.part.thickness, np.flatnonzero(chamber.source >= 0)
    assert thickness is not None
    expected = plate_mobility(thickness[chamber.source[own]].astype(float), part, 4430.0)
    np.testing.assert_allclose(flexure.mobility[own], expected, rtol=1e-6)
    # the picture shows Zener's restitution of a ball of 2 mm at the sonotrode's peak speed
    mass, speed = 7800.0 * math.pi / 6.0 * 2e-3**3, blade.sonotrode.peak_speed
    parameter = zener_parameter(expected, flexure.modulus, 1e-3, mass, speed)
    softness = softness_of_part(blade, chamber.part)
    assert softness is not None
    np.testing.assert_allclose(softness[chamber.source[own]], zener_restitution(parameter))


def test_a_face_that_bends_counts_with_its_rms_speed(blade: Design, chamber: Chamber) -> None:
    profile = {"share_at_mm": [[0, 0.9], [40, 0.9]]}
    even = blade.changed({"sonotrode.amplitude_profile": profile})
    slower = blade.changed({"sonotrode.amplitude_um": 0.9 * blade.sonotrode.zero_to_peak_um})
    found, expected = (softness_of_part(one, chamber.part) for one in (even, slower))
    assert found is not None
    assert expected is not None
    np.testing.assert_allclose(found, expected)
    assert (found >= softness_of_part(blade, chamber.part)).all()


def test_thick_parts_are_rigid_by_themselves() -> None:
    """A plate of 10 mm loses less than 2 % of the restitution, and a gear's teeth are no plates."""
    for design in (plate_design(), load_design(DESIGNS / "gear.toml")):
        chamber = build_chamber(design)
        assert chamber.part.thickness is None
        assert not thin_notes(chamber)
        assert flexure_of_surfaces(design, chamber, chamber_mesh(chamber)) is None
        assert flexure_facts(design, chamber) == {}
        assert mean_softness(design, chamber) == 1.0


def test_softness_is_told_by_the_area_in_the_chamber(blade: Design, chamber: Chamber) -> None:
    """Of a target of which one triangle alone is in the chamber, it is that of the triangle."""
    softness = softness_of_part(blade, chamber.part)
    assert softness is not None
    target = np.flatnonzero(chamber.part.target & (softness < 1.0))
    for one in (target[softness[target].argmin()], target[softness[target].argmax()]):
        exposed = np.where(chamber.part.target, 0.0, 1e-6)  # what is no target does not count
        exposed[one] = 1e-6
        alone = replace(chamber, exposed_area=exposed)
        assert mean_softness(blade, alone) == pytest.approx(softness[one])
        facts = flexure_facts(blade, alone)["flexure"]
        assert facts["lowers_restitution_on_share"] == float(softness[one] < 0.98)
        assert facts["restitution_times"] == pytest.approx(softness[one], rel=5e-3)


def test_flexure_can_be_left_out_and_asked_for(blade: Design) -> None:
    without = build_chamber(blade.changed({"effects.flexure": False}))
    assert without.part.thickness is None
    assert not thin_notes(without)
    # asked for, a plate of 10 mm is no longer rigid
    plate = plate_design().changed({"effects.flexure": TITANIUM | STEEL})
    asked = build_chamber(plate)
    cavity = analytic_cavity(plate, asked)
    for mesh in (chamber_mesh(asked), cavity):
        flexure = flexure_of_surfaces(plate, asked, mesh)
        assert flexure is not None
        of_part = flexure.mobility[mesh.tags == TAG_PART]
        expected = plate_mobility(10e-3, 113.8e9 / (1.0 - 0.342**2), 4430.0)
        np.testing.assert_allclose(of_part, expected, rtol=1e-6)
        assert not flexure.mobility[mesh.tags != TAG_PART].any()
    block = load_design(DESIGNS / "gear.toml").changed({"effects.flexure": TITANIUM | STEEL})
    assert "the part is no thin plate anywhere" in thin_notes(build_chamber(block))[0]


def test_an_unknown_metal_is_told_only_of_a_thin_part(blade: Design) -> None:
    law = {"C0": 0.9, "v0_m_s": 0.5, "hardness_HB": 330.0}
    unknown = blade.changed({"materials.part": law})
    assert plate_metals(unknown) is None
    chamber = build_chamber(unknown)
    assert chamber.part.thickness is None
    (note,) = thin_notes(chamber)
    assert "which is left out because the metal is not known: name an alloy" in note


@pytest.mark.parametrize(
    ("flexure", "told"),
    [
        (True, r"effects.flexure: given, but the metal is not known; name an alloy"),
        (TITANIUM, r"effects.flexure: given, but the metal is not known"),
        ({"part_E_GPa": 113.8}, r"effects.flexure.part_poisson: missing beside part_E_GPa"),
        ({"shot_poisson": 0.3}, r"effects.flexure.shot_E_GPa: missing beside shot_poisson"),
        ({"part_E_GPa": 0.0}, r"effects.flexure.part_E_GPa: given 0.*1 to 1500 GPa"),
        ("thin", r"effects.flexure: given 'thin'"),
        ({"off": True}, r"effects.flexure.off: unknown"),
    ],
)
def test_bad_flexure_is_refused_by_name(flexure: Any, told: str) -> None:
    """Of a part and balls that no name in the catalogue tells of."""
    law = {"C0": 0.9, "v0_m_s": 0.5}
    values = {
        "materials.part": law | {"hardness_HB": 330.0},
        "materials.shot": law,
        "materials.wall": law,
        "materials.sonotrode": law,
        "shot.material": None,
        "shot.density_kg_m3": 7800.0,
    }
    with pytest.raises(InputError, match=told):
        plate_design().changed(values | {"effects.flexure": flexure})
