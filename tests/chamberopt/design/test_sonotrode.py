"""Amplitude over a sonotrode's face, and blocks of which the floor is made."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import amplitude_notes, warnings
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design, save_design
from chamberopt.design.sonotrode import Face
from sim_core import Vibration
from sim_core.effects.amplitude_profile import shares_at
from tests.helpers.synthetic import plate_design

FALLING = [[0.0, 1.2], [20.0, 1.1], [60.0, 0.9]]


@pytest.fixture(scope="module")
def rigid():
    return plate_design()


@pytest.fixture(scope="module")
def mesh(rigid):
    return chamber_mesh(build_chamber(rigid))


def bent(design, points=FALLING, **more):
    return design.changed({"sonotrode.amplitude_profile": {"share_at_mm": points, **more}})


def test_without_a_profile_the_sonotrode_is_a_rigid_piston(rigid, mesh) -> None:
    scene = build_scene(rigid, mesh, 1)
    assert scene.physics.vibration.profile is None
    assert rigid.sonotrode.largest_amplitude == rigid.sonotrode.amplitude
    assert rigid.sonotrode.rms_peak_speed == rigid.sonotrode.peak_speed
    assert amplitude_notes(rigid) == []


def test_the_scene_has_the_amplitude_of_each_place(rigid, mesh) -> None:
    design = bent(rigid)
    vibration = build_scene(design, mesh, 1).physics.vibration
    places = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.01], [0.0, -0.06, 0.0]])
    amplitude = vibration.amplitude * shares_at(vibration, places)
    np.testing.assert_allclose(
        amplitude, rigid.sonotrode.amplitude * np.array([1.2, 1.1, 0.9]), rtol=1e-12
    )
    assert isinstance(vibration, Vibration)


def test_the_shot_starts_at_the_rms_speed_of_the_face(rigid, mesh) -> None:
    design = bent(rigid)
    rms = design.sonotrode.amplitude_profile.rms
    assert 0.9 < rms < 1.05
    one, other = (build_scene(each, mesh, 1).balls.velocities for each in (design, rigid))
    np.testing.assert_allclose(one, rms * other, rtol=1e-12)
    even = bent(rigid, [[0.0, 0.8], [60.0, 0.8]])
    assert even.sonotrode.amplitude_profile.rms == pytest.approx(0.8)


def test_one_line_says_what_the_amplitude_does(rigid) -> None:
    assert amplitude_notes(bent(rigid, [[0.0, 1.0], [30.0, 0.97], [60.0, 0.9]])) == [
        "amplitude over the face: 1.00 in the middle to 0.90 at 60 mm, rms 0.95"
    ]
    (text,) = amplitude_notes(bent(rigid, [[0.0, 0.9], [30.0, 1.1], [60.0, 1.0]]))
    assert ", at most 1.10, rms " in text


def test_a_saved_design_has_its_profile(rigid, tmp_path) -> None:
    design = bent(rigid, middle_mm=[1.0, -2.0])
    path = tmp_path / "design.toml"
    save_design(design, path)
    assert load_design(path).sonotrode == design.sonotrode
    assert not design.sonotrode.is_centred
    assert bent(rigid).sonotrode.is_centred


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0.0, 1.0]], "share_at_mm: given 1 points; allowed: two or more pairs"),
        ([[1.0, 1.0], [60.0, 0.9]], "share_at_mm.0.0: given 1; the first point is the middle"),
        ([[0.0, 1.0], [60.0, 2.5]], "share_at_mm.1.1: given 2.5; allowed: a share from 0 to 2"),
        ([[0.0, 1.0], [60.0, 0.9], [50.0, 0.9]], "given 50 after 60 mm; give each distance once"),
        ([[0.0, 0.0], [60.0, 0.0]], "given no share of 0.1 or more"),
        ([[0.0, 1e-300], [60.0, 1e-300]], "given no share of 0.1 or more"),
    ],
)
def test_wrong_profiles_are_refused(rigid, points, message) -> None:
    with pytest.raises(InputError, match=r"sonotrode.amplitude_profile.*") as error:
        bent(rigid, points)
    assert message in str(error.value)


def test_a_profile_must_reach_the_rim_and_bend_as_metal_does(rigid, mesh) -> None:
    short = r"^sonotrode.amplitude_profile ends at 0.02 m from its middle, and the face goes on to"
    with pytest.raises(InputError, match=short):
        build_scene(bent(rigid, [[0.0, 1.0], [20.0, 0.9]]), mesh, 1)
    with pytest.raises(InputError, match=r"sonotrode.amplitude_profile: .* would lean by up to"):
        build_scene(bent(rigid, [[0.0, 2.0], [0.5, 0.0], [60.0, 0.0]]), mesh, 1)


def test_the_nominal_radius_reaches_the_rim(rigid, mesh) -> None:
    """The rim is a polygon whose corners are a little further out."""
    nominal = 0.5 * rigid.chamber.diameter_mm
    build_scene(bent(rigid, [[0.0, 1.0], [nominal, 0.9]]), mesh, 1)


def test_a_further_sonotrode_bends_about_its_own_middle(rigid) -> None:
    face = {
        "at_mm": [20.0, 0.0, 30.0], "axis": [-1.0, 0.0, 0.0], "diameter_mm": 10.0,
        "frequency_khz": 20.0, "amplitude_um": 20.0,
    }  # fmt: skip
    profile = {"share_at_mm": [[0.0, 1.0], [5.0, 0.9]]}
    design = rigid.changed({"sonotrodes": [{**face, "amplitude_profile": profile}]})
    assert amplitude_notes(design)[0].startswith("amplitude over the face of sonotrodes.0: 1.00")
    profile = {**profile, "middle_mm": [1.0, 0.0]}
    with pytest.raises(InputError, match=r"amplitude_profile.middle_mm: given for a further"):
        rigid.changed({"sonotrodes": [{**face, "amplitude_profile": profile}]})


def block_warnings(design) -> list[str]:
    found = warnings(design, build_chamber(design))
    return [one.text for one in found if one.kind is WarningKind.NARROW_FLOOR]


def test_a_floor_of_blocks_is_simulated_as_one_face(rigid, mesh) -> None:
    width = rigid.value("chamber.diameter_mm")
    blocks = {"size_mm": [0.5 * width, width], "columns": 2}
    made = rigid.changed({"sonotrode.face": blocks})
    assert made.sonotrode.face.joints_mm == ([0.0], [])
    assert made.sonotrode.face.in_words.startswith("2 blocks of")
    np.testing.assert_array_equal(build_chamber(made).vertices, build_chamber(rigid).vertices)
    assert block_warnings(made) == []
    large = {"size_mm": [width, width], "columns": 2}
    (warning,) = block_warnings(rigid.changed({"sonotrode.face": large}))
    assert "wider than the floor: 2 blocks" in warning
    assert "sonotrode.face.columns = 1 and sonotrode.face.rows = 1" in warning
    with pytest.raises(InputError, match=r"sonotrode.face: 2 blocks .* but the floor needs"):
        build_chamber(rigid.changed({"sonotrode.face": {**blocks, "size_mm": [10.0, width]}}))
    disc = rigid.changed({"sonotrode.face": {"name": "A", "diameter_mm": width}})
    np.testing.assert_array_equal(build_chamber(disc).vertices, build_chamber(rigid).vertices)
    with pytest.raises(InputError, match=rf'sonotrode.face: "A" .* needs {width:g} mm about'):
        build_chamber(disc.changed({"sonotrode.face.diameter_mm": width - 0.01}))
    with pytest.raises(InputError, match="each of which has its own: not supported"):
        bent(made)


def test_joints_of_blocks_end_where_the_floor_does() -> None:
    """On a disc each is a chord, on a ring two, and past its rim there is none."""
    face = Face(size_mm=(20.0, 30.0), columns=3, rows=2)
    disc = trimesh.creation.cylinder(radius=0.02, height=0.01, sections=4096)
    floor = disc.faces[(disc.triangles_center[:, 2] < -4.999e-3)]
    points, half = np.asarray(disc.vertices), 1e3 * np.sqrt(0.02**2 - 0.01**2)
    chords = [[[x, -half], [x, half]] for x in (-10.0, 10.0)] + [[[-20.0, 0.0], [20.0, 0.0]]]
    found = 1e3 * face.joints_on(points, floor)
    np.testing.assert_allclose(found[:, :, :2], chords, atol=1e-3)
    ring = trimesh.creation.annulus(r_min=0.008, r_max=0.02, height=0.01, sections=4096)
    floor = ring.faces[ring.triangles_center[:, 2] < -4.999e-3]
    (left, right) = 1e3 * Face(size_mm=(40.0, 30.0), rows=2).joints_on(ring.vertices, floor)
    np.testing.assert_allclose([left[:, 0], right[:, 0]], [[-20, -8], [8, 20]], atol=1e-3)
    far = ring.vertices + np.array([0.05, 0.0, 0.0])
    wide = Face(size_mm=(60.0, 60.0), columns=2).joints_on(far, floor)
    assert wide.shape == (0, 2, 3)


def test_shares_are_measured_up_to_the_distance_that_the_message_allows(rigid) -> None:
    farthest = 1000.0  # mm
    assert bent(rigid, [[0.0, 1.2], [farthest, 0.9]]).sonotrode.amplitude_profile is not None
    with pytest.raises(InputError, match=f"given 1001; allowed: 0 to {farthest:g} mm"):
        bent(rigid, [[0.0, 1.2], [farthest + 1.0, 0.9]])
