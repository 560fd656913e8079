"""Where the energy goes: what the rebounds lose is what the shot has less, to rounding."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import build_scene
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.documents.wording import energy_lines
from chamberopt.printers import terminal
from chamberopt.results.impact_energy import BALLS, PART, energy_lost, require_mesh, simulate_energy
from chamberopt.results.rebuild import RebuiltReplica
from sim_core import energies, simulate
from tests.helpers.results.report_folders import simulated
from tests.helpers.synthetic import plate_design

SMOOTH = {"effects.friction": "none", "effects.roughness": "none"}
SECONDS = 0.05


@pytest.fixture(scope="module")
def still() -> RebuiltReplica:
    """Thirty smooth balls in the plate's chamber, over a sonotrode that does not move."""
    design = plate_design().changed(SMOOTH)
    chamber = build_chamber(design)
    scene = build_scene(design, chamber.mesh, 1)
    physics = scene.physics._replace(vibration=None, rest=None)
    scene = replace(scene, physics=physics, duration=SECONDS, warmup=0.0)
    result = SimpleNamespace(design=design, folder=Path("made_up"))
    return RebuiltReplica(result, chamber, None, scene)


def test_what_rebounds_lose_is_what_the_shot_has_less(still: RebuiltReplica) -> None:
    found = simulate_energy(still)
    ran = simulate(still.scene, frames=np.array([0.0, SECONDS]))
    before, after = energies(ran.frames, still.scene.balls, still.scene.physics.gravity).total
    assert after < 0.9 * before
    assert found.lost * SECONDS == pytest.approx(before - after, rel=1e-9)
    names = {one.name for one in found.surfaces}
    assert {PART, BALLS, "the sonotrode"} <= names
    lost = [one.lost_power.value for one in found.surfaces]
    assert lost == sorted(lost, reverse=True)


def test_maps_have_the_power_of_their_surface(still: RebuiltReplica) -> None:
    """Power over area, times areas of bins: Ø 50 mm by 15 mm have 2356 mm² of wall."""
    found = simulate_energy(still)
    by_name = {one.name: one for one in found.surfaces}
    face, wall = found.maps  # the plate closes the chamber: there is no ceiling
    of_wall = sum(
        one.impact_power.value
        for name, one in by_name.items()
        if name not in (PART, BALLS, "the sonotrode")
    )
    widths = np.diff(np.radians(wall.across)) * 25e-3
    area = np.outer(widths, np.diff(wall.up))
    assert area.sum() == pytest.approx(np.pi * 50e-3 * 15e-3, rel=0.01)
    assert np.nansum(wall.power * area) == pytest.approx(of_wall, rel=0.1)
    cells = np.outer(np.diff(face.across), np.diff(face.up))
    whole = np.isfinite(face.power)
    assert cells[whole].sum() == pytest.approx(np.pi * 25e-3**2, rel=0.15)
    assert by_name["the sonotrode"].area == pytest.approx(np.pi * 25e-3**2, rel=0.01)


def test_a_rebound_by_hand() -> None:
    """2 kg at 3 m/s with e = 0.5 lose 3/4 of 9 J."""
    assert energy_lost(np.array(2.0), np.array(3.0), np.array(0.5)) == pytest.approx(6.75)


def test_the_table_adds_up(still: RebuiltReplica) -> None:
    found = simulate_energy(still)
    head, *rows = terminal.text(energy_lines(found)).splitlines()
    assert head.split()[-2:] == ["share,", "%"]
    shares = [float(row.split()[-1]) for row in rows[: len(found.surfaces)]]
    assert math.isclose(sum(shares), 100.0, abs_tol=0.5)


def test_exact_surfaces_are_refused(still: RebuiltReplica) -> None:
    with pytest.raises(InputError, match="simulate it without --analytic"):
        require_mesh(replace(still, cavity=object()))


def test_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    folder = simulated(tmp_path / "plate")[0]
    capsys.readouterr()
    assert main(["energy", str(folder), str(tmp_path / "energy.png")]) == 0
    told = capsys.readouterr().out
    assert "sonotrode" in told
    assert BALLS in told
    assert (tmp_path / "energy.png").stat().st_size > 10_000
