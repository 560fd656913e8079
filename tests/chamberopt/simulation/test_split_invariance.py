"""Figures belong to the surface: other triangles of the same surface give the same figures."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import independent_difference
from chamberopt.common.executor import local_executor
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.load import Design, load_design
from chamberopt.simulation.evaluate import evaluate
from chamberopt.simulation.evaluation import Evaluation
from sim_core import closest_points
from tests.helpers.synthetic import DESIGNS, evaluation_of

FIGURES = ("mean_coverage", "std_coverage")
# A bar hangs from the ceiling: its lower end and sides are peened.
BAR = {
    "part.target.direction": None,
    "part.target.angle_deg": None,
    "part.target.box_mm": [[-7, -5, -0.1], [7, 5, 7.5]],
    "chamber.diameter_mm": 40,
    "chamber.height_mm": 24,
    "chamber.sonotrode_distance_mm": 10,
    "shot.mass_g": 1.5,
    "process.treatment_time_s": 60,
    "process.accuracy.simulated_time_s": 1.5,
}


def split(mesh: trimesh.Trimesh, times: int) -> trimesh.Trimesh:
    for _ in range(times):
        mesh = mesh.subdivide()
    return mesh


def bar_designs(folder: Path) -> dict[str, Design]:
    """The bar as given, split in four, and in irregular triangles."""
    gear = load_design(DESIGNS / "gear.toml")
    bar = trimesh.creation.box(bounds=[[-6, -4, 0], [6, 4, 20]])
    # The target ends at a height where triangles meet.
    bar = split(bar, 3)
    designs = {}
    for name, mesh in (("given", bar), ("split in 4", split(bar, 1))):
        path = folder / f"{name}.stl"
        mesh.export(path)
        designs[name] = gear.changed(BAR | {"part.mesh": str(path)})
    irregular = {"part.target.element_mm": 0.9}
    return designs | {"irregular": designs["given"].changed(irregular)}


def booked(hits: Hits, chamber: Chamber) -> Hits:
    """The same impacts, on the triangles of another mesh of the part."""
    found = closest_points(chamber_mesh(chamber), hits.place.astype(float), 1e-5)
    triangle = chamber.source[found.triangle]
    assert (triangle >= 0).all()
    return replace(hits, triangle=triangle.astype(np.int32))


def simulated(design: Design) -> tuple[Chamber, Evaluation]:
    chamber = build_chamber(design)
    with local_executor(2) as executor:
        return chamber, evaluate(design, chamber, executor)


def require_agreement(
    found: dict[str, Evaluation], names: tuple[str, ...], tolerance: float = 1.5
) -> None:
    """All pairs differ by no more than their intervals allow; 1.5 is three standard errors."""
    for one, other in combinations(found, 2):
        for name in (*names, "objective"):
            both = [
                found[key].objective if name == "objective" else found[key].metrics[name]
                for key in (one, other)
            ]
            gap = independent_difference(*both)
            assert np.isfinite(gap.half_width), (one, name, both)
            assert abs(gap.value) <= tolerance * gap.half_width, (one, other, name, both)


@pytest.fixture(scope="module")
def bars(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Chamber, Evaluation]]:
    designs = bar_designs(tmp_path_factory.mktemp("bars"))
    return {name: simulated(design) for name, design in designs.items()}


def test_meshes_are_different_and_their_targets_the_same(
    bars: dict[str, tuple[Chamber, Evaluation]],
) -> None:
    area = {name: chamber.part.area[chamber.part.target] for name, (chamber, _) in bars.items()}
    count = {name: len(own) for name, own in area.items()}
    assert count["split in 4"] == 4 * count["given"]
    assert count["irregular"] not in (count["given"], count["split in 4"])
    for own in area.values():
        assert own.sum() == pytest.approx(area["given"].sum(), rel=1e-6)


def test_each_mesh_simulated_on_its_own_gives_the_same_figures(
    bars: dict[str, tuple[Chamber, Evaluation]],
) -> None:
    found = {name: evaluation for name, (_, evaluation) in bars.items()}
    for evaluation in found.values():
        assert evaluation.metrics["mean_coverage"].half_width < 0.05
        assert evaluation.crease_share > 0.1  # what triangles would smear
        assert evaluation.reachable == pytest.approx(1.0, abs=1e-3)
    require_agreement(found, FIGURES)


def test_the_same_impacts_on_other_triangles_give_the_same_figures(
    bars: dict[str, tuple[Chamber, Evaluation]], tmp_path: Path
) -> None:
    designs = bar_designs(tmp_path)
    _, given = bars["given"]
    for name, (chamber, _) in bars.items():
        again = evaluation_of(designs[name], chamber, [booked(one, chamber) for one in given.hits])
        for figure in FIGURES:
            for metrics, wanted in (
                (again.metrics, given.metrics),
                (again.metrics_of_wide, given.metrics_of_wide),
            ):
                assert metrics[figure].value == pytest.approx(wanted[figure].value, abs=0.01), name
        assert again.crease_share == pytest.approx(given.crease_share, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize(("part", "seconds"), [("gear", 4.5), ("blade", 10.0)])
def test_the_shipped_parts_split_and_remeshed(part: str, seconds: float, tmp_path: Path) -> None:
    design = load_design(DESIGNS / f"{part}.toml")
    design = design.changed({"process.accuracy.simulated_time_s": seconds})
    mesh = trimesh.load_mesh(design.part.mesh_path)
    found = {"given": simulated(design)[1]}
    for times in (1, 2):
        path = tmp_path / f"{times}.stl"
        split(mesh, times).export(path)
        found[f"split {times} times"] = simulated(design.changed({"part.mesh": str(path)}))[1]
    element = {"part.target.element_mm": 0.5 if part == "gear" else 0.8}
    found["irregular"] = simulated(design.changed(element))[1]
    require_agreement(found, FIGURES)
