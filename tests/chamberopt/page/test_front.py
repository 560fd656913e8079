"""The front page's server: a part's file comes in, `new` proposes a design for it, and it opens."""

import http.client
import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import trimesh

from chamberopt.design.load import load_design
from tests.chamberopt.page.conftest import Served
from tests.hunt.meshes import ROOT

PROPOSED = {
    "part": "box.stl", "unit": "mm", "material": "", "shot": "steel", "shape": "", "target": [],
    "shop": "", "calibration": "", "pilot": False, "intensity": "", "coverage": "", "ball-mm": "",
    "pose": "",
}  # fmt: skip


@pytest.fixture
def front(tmp_path: Path) -> Iterator[Served]:
    page = Served(tmp_path)
    yield page
    page.process.kill()
    page.process.communicate()


def upload(front: Served, name: str, content: bytes) -> Any:
    answer = front._send("POST", f"/upload?name={name}", content, {"origin": front.origin})
    return json.loads(answer.read())


def of_front(front: Served) -> dict[str, Any]:
    return dict(json.loads(front.get("/front").read()))


@pytest.mark.long
def test_a_part_becomes_a_design_that_opens(front: Served, tmp_path: Path) -> None:
    box = trimesh.creation.box((30.0, 20.0, 10.0)).export(file_type="stl")
    for _ in range(2):  # again: the same bytes are the same part
        assert upload(front, "part.STL", box) == {"part": "part.STL"}
    shutil.copy(ROOT / "designs/shop/machine.toml", tmp_path)
    here = of_front(front)
    assert here["calibrations"] == ["machine.toml"]
    assert here["parts"] == ["box.stl", "part.STL"]
    assert here["designs"] == ["design.toml"]
    assert ["42CrMo4", "steel"] in here["alloys"]
    known = {"part": "part.STL", "unit": ""}
    sizes = front.ask("/look", known)["sizes"]
    assert sizes["mm"] == "30 x 20 x 10 mm"
    assert front.ask("/look", known | {"unit": "cm"})["size"] == "300 x 200 x 100 mm"
    shutil.copy(ROOT / "designs/parts/fir_tree.step", tmp_path)
    names = front.ask("/look", {"part": "fir_tree.step", "unit": ""})["names"]
    assert ["FIR_TREE", "1796 mm²"] in names
    assert "#ff0000" not in dict(names)  # the colour of just this surface
    wishes = {"unit": "mm", "material": "IN718", "coverage": "200", "ball-mm": "1.2",
              "calibration": "machine.toml"}  # fmt: skip
    started = front.ask("/propose", PROPOSED | known | wishes)
    assert started["result"] == "part"
    assert "running" in front.ask("/propose", PROPOSED)["error"]
    while (now := json.loads(front.get("/status").read()))["exit"] is None:
        time.sleep(0.2)
    assert now["exit"] == 0, now["lines"]
    told = now["proposal"]
    assert {row["name"] for row in told["rows"]} >= {"target", "chamber", "balls", "time"}
    assert told["matters"][0]["mark"] == "Target chosen by size alone"
    assert sum(one["is_target"] for one in told["choices"]) == 1
    assert now["picture"][0] == "part/design.png"
    design = load_design(tmp_path / "part" / "design.toml")
    assert design.calibration is not None
    assert design.process.coverage_percent == 200
    assert design.shot.diameter == pytest.approx(1.2e-3)
    assert (tmp_path / "part" / design.part.mesh).samefile(tmp_path / "part.STL")
    assert front.get("/files/part/design.png").status == 200
    assert "no design is open" in front.ask("/read", {})["error"]
    assert front.ask("/open", {"design": "part/design.toml"}) == {}
    fields = {one["name"]: one for one in front.ask("/read", {})["fields"]}
    assert fields["chamber.height_mm"]["reason"]
    assert b'id="numbers"' in front.get("/").read()
    assert front.ask("/close", {}) == {}
    assert b'id="drop"' in front.get("/").read()
    assert of_front(front)["designs"] == ["design.toml", "part/design.toml"]


def test_a_wrong_file_or_wish_is_answered_in_words(front: Served, tmp_path: Path) -> None:
    box = (tmp_path / "box.stl").read_bytes()
    before = sorted(tmp_path.rglob("*"))
    names = "evil.toml", "..%2Fx.stl", "%2Ftmp%2Fx.stl", ".x.stl", ""
    for name, said in (("box.stl", "already"), *((name, "not a part") for name in names)):
        assert said in upload(front, name, box + b"another")["error"]
    assert "broken.stl" in upload(front, "broken.stl", b"solid of nothing")["error"]
    wrong = {"unit": "ft", "shape": "own.py", "shot": "gravel", "pose": "up"}
    for option, given in wrong.items():
        error = front.ask("/propose", PROPOSED | {option: given})["error"]
        assert f"--{option}: given {given!r}; allowed" in error
    for wish, said in (
        ({"material": "--help"}, "--material: given '--help'; choose one that the field lists"),
        ({"material": "titanium"}, "--material: given 'titanium'; did you mean 'Ti"),
        ({"coverage": "5"}, "--coverage: given 5; allowed: from 100 to 1000 %"),
        ({"ball-mm": "large"}, "--ball-mm: given 'large'; give a number"),
        ({"intensity": "15A"}, "--intensity: given '15A'"),
        ({"intensity": "usual", "pilot": True}, "give --material"),
        ({"intensity": "0.15A"}, "--intensity: it takes pilot runs"),
    ):
        assert said in front.ask("/propose", PROPOSED | wish)["error"]
    several = {"pose": "up", "intensity": "banana", "coverage": "5", "ball-mm": "-3"}
    answer = front.ask("/propose", PROPOSED | several)
    assert {*answer["at"]} == {*several}  # all of them at once
    assert answer["at"]["ball-mm"][0].startswith("given -3; allowed")
    for option in ("part", "shop", "calibration"):
        error = front.ask("/propose", PROPOSED | {option: "../x.stl"})["error"]
        assert "outside the folder" in error
    assert "outside the folder" in front.ask("/look", {"part": "../x", "unit": ""})["error"]
    assert "unit: given ft" in front.ask("/look", {"part": "box.stl", "unit": "ft"})["error"]
    (tmp_path / "own.toml").write_text(
        (tmp_path / "design.toml").read_text().replace('"cylinder"', '"shape.py"')
    )
    assert "--trust-shape" in front.ask("/open", {"design": "own.toml"})["error"]
    (tmp_path / "own.toml").unlink()
    assert "outside" in front.ask("/open", {"design": "../design.toml"})["error"]
    assert sorted(tmp_path.rglob("*")) == before
    assert b'id="drop"' in front.get("/").read()


def test_a_part_of_the_program_is_an_example(front: Served, tmp_path: Path) -> None:
    for _ in range(2):
        assert front.ask("/example", {}) == {"part": "fir_tree.step"}
    shipped = ROOT / "designs/parts/fir_tree.step"
    assert (tmp_path / "fir_tree.step").read_bytes() == shipped.read_bytes()


def test_files_are_taken_from_the_page_alone_and_not_too_large(front: Served) -> None:
    own = {"origin": front.origin}
    for headers in ({}, {"origin": "null"}, own | {"cookie": ""}, own | {"x-chamberopt-key": ""}):
        assert front._send("POST", "/upload?name=x.stl", b"solid", headers).status == 403
    connection = http.client.HTTPConnection(front.host, timeout=60)
    connection.putrequest("POST", "/upload?name=x.stl", skip_host=True)
    sent = {"host": front.host, "cookie": front.cookie, "x-chamberopt-key": front.key, **own}
    for name, text in (sent | {"content-length": "600000000"}).items():
        connection.putheader(name, text)
    connection.endheaders()
    answer = connection.getresponse()
    assert answer.status == 413
    assert b"this file has more than 500 MB" in answer.read()


def test_a_proposal_that_asks_ends_in_words(front: Served) -> None:
    """Without a unit, which the file does not state."""
    front.ask("/propose", PROPOSED | {"unit": ""})
    while (now := json.loads(front.get("/status").read()))["exit"] is None:
        time.sleep(0.2)
    assert now["exit"] == 2
    assert "does not state the unit" in now["lines"][-1]


def test_a_draft_is_told_before_the_pilots(front: Served, tmp_path: Path) -> None:
    """It has the chamber's sizes, and is gone with the command that is stopped."""
    front.ask("/propose", PROPOSED | {"pilot": True})
    while (now := json.loads(front.get("/status").read()))["exit"] is None:
        if now["proposal"]:
            break
        time.sleep(0.1)
    assert now["exit"] is None
    assert now["answer"] is None
    rows = {row["name"]: row["value"] for row in now["proposal"]["rows"]}
    assert "height" in rows["chamber"][0]
    stage = now["stage"]
    assert 1 <= stage["number"] <= stage["count"] == len(stage["names"]) == 7
    assert stage["names"][0] == "reading the part and choosing sizes"
    assert sorted(map(int, stage["began"])) == [*range(1, stage["number"] + 1)]
    assert not any("draft" in line or "stage" in line for line in now["lines"])
    assert b'"shape_mm"' in front.ask("/chamber", {})
    assert b'"unpeened"' in front.ask("/chamber", {"exact": True})
    front.ask("/stop", {})
    while (now := json.loads(front.get("/status").read()))["exit"] is None:
        time.sleep(0.1)
    assert now["proposal"] is None
    assert front.ask("/chamber", {})["error"] == "no chamber is proposed yet"
    assert not (tmp_path / "box").exists()


def test_the_page_begins_with_the_part_that_is_given(tmp_path: Path) -> None:
    page = Served(tmp_path, "box.stl")
    try:
        assert of_front(page)["first"] == "box.stl"
        assert b'id="drop"' in page.get("/").read()
    finally:
        page.process.kill()
        page.process.communicate()
