"""The commands of worked examples in docs/ run as printed, on settings that make them quick.

The commands of all pages name what there is, and tables in TOML have keys that there are.
"""

import json
import re
import shlex
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.blind_prediction import compared as compared_blind
from benchmarks.blind_prediction import predicted
from benchmarks.made_up_shop import SHOP, compared
from chamberopt.cli import main
from chamberopt.cli.command_line import app
from chamberopt.common.toml_errors import key_lines
from chamberopt.design.zones import Zone
from chamberopt.pictures.subprocess_drawing import missing_opengl
from chamberopt.search.study import load_study
from docs.generators.keys import PAGES as FILES
from docs.generators.keys import every_key, meaning

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
OF_PAGES = pytest.mark.parametrize("page", PAGES, ids=[one.stem for one in PAGES])
# Tables whose keys are names: of numbers, metrics, or parts of a design.
NAMED = ("vary", "constraints", "tolerances", "objective.sum", "search_accuracy", "steps")
QUICK = {
    "replicas": "3\npoints = 1000", "simulated_time_s": "0.05", "warmup_time_s": "0.02",
    "evaluations": "2", "confirm": "1", "confirm_replicas": "3",
    "objective_half_width": "0.5\nmax_replicas = 3",
}  # fmt: skip


def commands(page: str) -> list[list[str]]:
    """The commands of a page of docs, as lists of words."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [line.split() for line in re.findall(r"^    (.*)$", text, re.MULTILINE)]


def blocks(page: Path) -> Iterator[str]:
    """The lines of a page that stand in blocks of code."""
    text = page.read_text(encoding="utf-8")
    fenced = re.findall(r"^ *```\w*\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return iter([*fenced, *re.findall(r"(?:^    .*\n)+", text, re.MULTILINE)])


@OF_PAGES
def test_commands_of_a_page_name_what_there_is(page: Path) -> None:
    """Command and options; arguments in capitals and dots stand for something."""
    lines = [line.strip() for block in blocks(page) for line in block.splitlines()]
    if page.stem == "CHANGELOG":  # what has been
        lines = []
    for line in lines:
        line = line.partition(" > ")[0]
        words = shlex.split(line, comments=True) if re.match(r"(chamberopt|python) ", line) else []
        if words[:1] == ["python"] and words[1:2] != ["-m"]:
            assert (ROOT / words[1]).is_file(), line
        elif words[:2] == ["python", "-m"] and words[2].startswith(("benchmarks", "tests")):
            assert (ROOT / f"{words[2].replace('.', '/')}.py").is_file(), line
        elif words[:1] == ["chamberopt"] and "…" not in line and "[" not in line:
            app.parse_args(words[1:], exit_on_error=False, print_error=False)


@OF_PAGES
def test_keys_in_a_page_are_keys_of_a_file(page: Path) -> None:
    known = {name for model in FILES.values() for name, _ in every_key(model)}
    text = page.read_text(encoding="utf-8")
    for block in re.findall(r"^ *```toml\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE):
        for name in key_lines(block):
            plain = re.sub(r"\.\d+\b", "", name)
            assert plain in known or plain.startswith(NAMED), f"{name} is no key of a file"


def test_every_key_says_what_it_means() -> None:
    said = {name: meaning(one) for model in FILES.values() for name, one in every_key(model)}
    assert len(said) > 200
    assert [name for name, text in said.items() if not text] == []


def test_the_gallery_has_every_picture() -> None:
    gallery = (ROOT / "docs/gallery.md").read_text(encoding="utf-8")
    pictures = [path.name for path in (ROOT / "docs/images").iterdir()]
    assert sorted(re.findall(r"\(images/(.*?)\)", gallery)) == sorted(pictures)
    # Each picture, or each group of pictures, stands below a command.
    for part in re.split(r"^## ", gallery, flags=re.MULTILINE)[1:]:
        assert re.match(r".*\n\n    (chamberopt|python) ", part)


def make_quick(path: Path) -> None:
    """Replace the settings of a design or a study that make it accurate."""
    text = path.read_text(encoding="utf-8")
    text = re.sub(
        r"^max_replicas = .*\n", "", text, flags=re.MULTILINE
    )  # comes with the half-width
    for name, value in QUICK.items():
        text = re.sub(rf"^{name} = [\d.]+", f"{name} = {value}", text, flags=re.MULTILINE)
    path.write_text(text, encoding="utf-8")


@pytest.mark.long
def test_the_peening_examples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for folder in ("designs", "studies"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for name in ("designs/shop/coupon", "designs/gear_zones", "studies/gear_zones"):
        make_quick(tmp_path / f"{name}.toml")
    monkeypatch.chdir(tmp_path)
    words = [
        rest
        for program, *rest in commands("tutorials/peening_examples.md")
        if program == "chamberopt"
    ]
    assert [name for name, *_ in words] == ["calibrate", "run", "report", "simulate", "report"]
    for command in words:
        assert main(command) == 0, (command, capsys.readouterr().err)
    assert (tmp_path / "results/shop/machine.toml").is_file()
    found = json.loads((tmp_path / "results/gear/result.json").read_text(encoding="utf-8"))
    assert [zone["name"] for zone in found["zones"]] == ["flank", "root"]
    assert found["metrics"]["flank.almen_intensity"]["value"] > 0.0
    assert "process.treatment_time_s" in found["tolerances"]["box"]
    for folder in ("gear_study", "gear"):
        page = (tmp_path / "results" / folder / "report.html").read_text(encoding="utf-8")
        assert "Limits, by the whole interval" in page


@pytest.mark.long
@pytest.mark.parametrize("page", ["coupons", "blind_prediction"])
def test_what_an_auditor_asks_of_a_shop(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "designs", tmp_path / "designs")
    for name in ("coupon", "blind"):
        make_quick(tmp_path / f"designs/shop/{name}.toml")
    monkeypatch.chdir(tmp_path)
    words = [rest for program, *rest in commands(f"how_to/{page}.md") if program == "chamberopt"]
    assert len(words) >= 3
    for command in words:
        assert main(command) == 0, (command, capsys.readouterr().err)
    if page == "coupons":
        assert (tmp_path / "results/coupon_machine/machine.toml").is_file()
    else:
        results = [Path("results/blind"), Path("results/blind_strip")]
        found = {name: value for name, (value, _) in predicted(*results).items()}
        assert len(found) == 6  # coverage and five arcs
        assert all(row["holds"] == "yes" for row in compared_blind(predicted(*results), found))


def test_the_shipped_calibration_holds_the_hidden_machine() -> None:
    rows = compared(SHOP / "machine.toml")
    names = ["amplitude", "C0", "v0", "hardness", "K", "beta"]
    assert [(row["parameter"], row["held"]) for row in rows] == [(name, "yes") for name in names]


@pytest.mark.long
def test_the_tutorial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("gmsh", reason="STEP needs the extra cad", exc_type=ImportError)
    monkeypatch.chdir(tmp_path)
    for program, *words in commands("tutorials/tutorial.md"):
        if program == "cd":
            monkeypatch.chdir(words[0])
        elif words[0] != "inspect" or not missing_opengl():
            assert main(words) == 0, (words, capsys.readouterr().err)
        if words[0] == "new":
            make_quick(Path("chamber/design.toml"))
            make_quick(Path("chamber/study.toml"))
    assert Path("results/study/process_sheet.pdf").read_bytes().startswith(b"%PDF")


def toml_blocks(page: str) -> list[str]:
    """The examples of TOML on a page."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(r"```toml\n(.*?)```", text, re.DOTALL)


def test_the_forms_of_a_study_file_make_one_study(tmp_path: Path) -> None:
    varied, limits, optimizer = toml_blocks("reference/study_file.md")
    limits = re.sub(r'^"root.*\n', "", limits, flags=re.MULTILINE)  # the gear has no zone
    optimizer = re.sub("^algorithm = .*\n", "", optimizer.removeprefix("[optimizer]\n"))
    design = f'design = "{(ROOT / "designs/gear.toml").as_posix()}"\n'
    path = tmp_path / "study.toml"
    path.write_text(f"{design}{varied}{limits}[optimizer]\n{optimizer}", encoding="utf-8")
    study = load_study(path)
    assert len(study.vary) == 9
    assert [phase.algorithm for phase in study.optimizer.phases] == ["sobol", "LN_BOBYQA"]


def test_the_zones_of_the_page_on_drawings_are_valid() -> None:
    (block,) = toml_blocks("how_to/drawing.md")
    zones = [Zone.model_validate(one) for one in tomllib.loads(block)["zones"]]
    assert [zone.is_spared for zone in zones] == [False, True]


@OF_PAGES
def test_no_line_of_a_page_is_taken_for_a_comment(page: Path) -> None:
    """The site leaves out lines that begin with a per cent sign."""
    lines = page.read_text(encoding="utf-8").splitlines()
    assert not [line for line in lines if line.lstrip().startswith("%")]
