"""Holder and mask are in a result, in its exported files, on its process sheet and in its page."""

from pathlib import Path

import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.design.design import Design, validate
from chamberopt.documents.sheet import AsBuilt, process_sheet
from chamberopt.export.chamber_files import write_3mf, write_fixtures, write_stl_per_surface
from chamberopt.results.arrays_file import load_chamber
from chamberopt.results.load import load_result
from chamberopt.results.vtp_files import cavity_surface, fixture_marks
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.results.report_folders import simulated
from tests.helpers.synthetic import plate_design, poisson_evaluation


def held(folder: Path) -> Design:
    """A box of 20 x 12 x 8 mm on a rod, with a mask on one end; its underside is the target."""
    trimesh.creation.box((20, 12, 8)).export(folder / "box.stl")
    data = plate_design(process__accuracy__points=1000).model_dump()
    down = {"direction": (0, 0, -1), "angle_deg": (0, 30)}
    data["part"] = {"mesh": str(folder / "box.stl"), "unit": "mm", "target": down}
    data["chamber"] = {
        "shape": "box",
        "length_mm": 60.0,
        "width_mm": 50.0,
        "height_mm": 40.0,
        "sonotrode_distance_mm": 15.0,
    }
    end = {"at": {"direction": (1, 0, 0), "angle_deg": (0, 30)}, "thickness_mm": 2.0}
    return validate(Design, {**data, "holder": {"kind": "rod"}, "mask": end})


def test_holder_and_mask_are_saved_exported_and_said(tmp_path: Path) -> None:
    design, folder = held(tmp_path), tmp_path / "result"
    chamber = build_chamber(design)
    save_simulation(folder, design, chamber, poisson_evaluation(design, chamber, 20.0))

    result = load_result(folder)
    kept = load_chamber(result)
    assert kept.fixtures.keys() == {"holder", "mask"}
    assert kept.fixtures["holder"].size == chamber.fixtures["holder"].size
    assert result.record.chamber.fixtures["mask"].covered_mm2 == pytest.approx(12 * 8)
    assert result.record.chamber.pieces_in_air == 0

    write_fixtures(folder, tmp_path / "bodies")
    for name, volume in (("holder", 1228.5), ("mask", 12 * 8 * 2)):
        body = trimesh.load(tmp_path / "bodies" / f"{name}.stl")
        assert body.is_watertight
        assert body.volume == pytest.approx(volume, rel=1e-3)
    write_stl_per_surface(folder, tmp_path / "surfaces")
    names = {one.stem for one in (tmp_path / "surfaces").iterdir()}
    assert names == {"part", "sonotrode", "wall", "holder", "mask"}
    write_3mf(folder, tmp_path / "chamber.3mf")

    sheet = process_sheet(result, AsBuilt((60.0, 50.0)))
    content = sheet.sections[0].content
    tables = {one.caption: dict(one.rows) for one in content if getattr(one, "caption", "")}
    assert tables["Chamber"]["holder"] == (
        "rod Ø 9.6 mm, 17 mm long, from (0, 0, 23) mm along (0, 0, 1), on 72.3 mm² of the part"
    )
    assert tables["Chamber"]["mask"] == "shell 2 mm thick, on 96 mm² of the part"
    assert set(fixture_marks(cavity_surface(kept))) == {"holder", "mask"}


def test_a_chamber_without_them_has_none_to_export(tmp_path: Path) -> None:
    folder, _ = simulated(tmp_path / "plain")
    with pytest.raises(InputError, match=r"neither a \[holder\] nor a \[mask\]"):
        write_fixtures(folder, tmp_path / "bodies")
