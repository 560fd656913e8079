"""What users see of a result of each kind is as it was: terminal, page, sheet, tables and JSON.

The commands make tiny results in this process, and what they show is compared with the texts in
tests/frozen, a folder for each kind. Words must be equal; numbers may differ by two thousandths,
and those of few digits have as many decimals as before. After a change that is wanted, write the
texts anew, and read in `git diff` what users will see:

    python -m tests.test_frozen_results

Another processor rounds differently, and each collision multiplies the difference. So a replica
lasts for a few collisions of each ball, and figures that take many dents get them from many
replicas and wide windows. A calibration simulates for longer, and from one processor to another its
answer moves by a part of its error: of it only the words and the size of the numbers are compared,
and the scene with zones has a machine of its own. What differs from run to run is masked: dates,
measured durations, versions, the machine, digests and sizes of pages.
"""

from __future__ import annotations

import csv
import html
import io
import json
import re
import shutil
import tempfile
import textwrap
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from difflib import unified_diff
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from matplotlib.figure import Figure

from chamberopt.cli import main
from chamberopt.common import executor
from chamberopt.common.versions import versions
from chamberopt.simulation import convergence as convergence_study
from chamberopt.simulation import timed_replicas
from chamberopt.workflows import comparison_folder
from tests.chamberopt.common.files.scene import write_scene
from tests.chamberopt.simulation.test_study import made_up_replica
from tests.helpers.synthetic import DESIGNS

FROZEN = Path(__file__).with_name("frozen")
RELATIVE = 2e-3  # allowed difference of two numbers
# Allowed difference of two numbers of a calibration: a share, and that of logarithms and chi².
ROUGH, ROUGH_ABSOLUTE, ROUGHLY = 0.3, 0.1, "calibrate/"
ROUNDING = 1e-12  # smaller numbers are rounding errors
DIGITS = 5  # stored of a number
ITEMS = 1  # stored of longer lists of numbers in JSON, beside their length
ROWS = 6  # stored of a longer table, beside their number
LINES = 40  # of differences that are shown
NAMES = sorted(path.relative_to(FROZEN).as_posix() for path in FROZEN.rglob("*.txt"))
SHEET = "sheet.txt"
MACHINE = Path(__file__).parent / "helpers" / "calibrated_machine.toml"
FORMATS = (".toml", ".csv", ".json", ".html")
# Not stored, because other files of the same kind of result have their content.
COPIES = (
    "history.csv", "inputs.json", "impacts.csv.json", "design.toml", "study.toml",
    "machine.toml", "pareto/out/best.toml", "sweep/out/best.toml",
)  # fmt: skip

# More shot in the tiny scene, and with MANY all the dents that times and percentiles take.
MANY = {"mass_g": "4", "replicas": "16", "gauge_mm2": "120"}
LIGHT = {**MANY, "mass_g": "2"}
BRIEF = {"replicas": "3", "simulated_time_s": "0.02", "warmup_time_s": "0.001"}  # of the plate
SEARCH = {"evaluations": "4", "confirm_replicas": "16", "design": '"many.toml"'}
ZONES = """
[[zones]]
name = "face"
target = { direction = [0, 0, -1], angle_deg = [0, 10] }
coverage_min = 0.2
intensity_mmA = [0.01, 0.5]
"""
TOLERANCES = """
[tolerances]
amplitude_um = 2
"shot.mass_g" = ["-10 %", 0]
"""
MEASURED = """
design = "many.toml"
[[strip]]
time_s = [8, 16, 32, 64, 128]
arc_mm = [0.24, 0.35, 0.45, 0.48, 0.52]
disc_mm = 30
[[coupon]]
coverage = [{ time_s = 3, percent = 43 }]
[[drop]]
surface = "part"
speed_m_s = 3
restitution = 0.45
[amplitude]
set_pv_um = 50
measured_pv_um = 49
[[impacts]]
per_s = 1450
[prior]
v0 = { sd_log = 0.1 }
C0 = { sd_log = 0.01 }
"""
PARETO = 'pareto = ["uniform_coverage", "minus_time_to_98_s"]'

# Commands of each kind, in an order in which each finds what it needs.
ONE = "--workers 1"
COMMANDS = {
    "calibrate": [f"calibrate measured.toml {ONE} --out calibrate/out"],
    "simulate": [
        f"simulate many.toml {ONE} --out simulate/out",
        "report simulate/out",
        "report simulate/out --sheet",
        f"export simulate/out --to impacts-csv {ONE} --out simulate/impacts.csv",
    ],
    "analytic": [f"simulate brief.toml --analytic {ONE} --out analytic/out", "report analytic/out"],
    "zones": [
        f"simulate zones.toml --tolerances {ONE} --out zones/out",
        "report zones/out",
        "report zones/out --sheet",
        "export zones/out --to tolerances-csv --out zones/tolerances.csv",
    ],
    "study": [
        f"run study.toml {ONE} --out study/out",
        "report study/out",
        "report study/out --sheet",
        "export study/out --to study-csv --out study/study.csv",
        f"run study.toml {ONE} --out study/out",  # it is finished
    ],
    "pareto": [f"run pareto.toml {ONE} --out pareto/out", "report pareto/out"],
    "sweep": [
        f"sweep study.toml --grid 2 {ONE} --out sweep/out",
        "export sweep/out --to study-csv --out sweep/study.csv",
        f"sweep study.toml --grid 2 {ONE} --out sweep/out",  # it is finished
    ],
    "accuracy": ["accuracy plate.toml --budget-s 14 --out accuracy/out"],
    "strip": [f"strip many.toml --disc-mm 30 {ONE} --out strip/out"],
    "compare": [f"compare simulate/out light.toml {ONE} --out compare/out"],
}

MASKED = "MASKED"
MASKED_KEYS = {"created", "timings_s", "seconds", "wall_s", "versions"}  # of JSON and of tables
TIMED = "to build the chamber|to simulate|to compute the coverage|run time of all"  # rows of pages
MASKS = {
    r"\d{4}-\d\d-\d\d(T[\d:.+]+)?": MASKED,
    r"\b[0-9a-f]{64}\b": MASKED,
    r"(?<=sha256 )([0-9a-f]{30,}( [0-9a-f]+)?|[0-9a-f]{12}\b)": MASKED,  # of a sheet, broken or cut
    r"(?<=chamberopt )\d[\w.]*": MASKED,
    r"(?<=chamberopt, simulated )\d[\w.]*": MASKED,
    r"[\d.]+(?= MB)": MASKED,
    r"(?<=candidates in )[\d.]+ \w+": MASKED,
    rf"^({TIMED})\n.*$": rf"\1\n{MASKED}",
    rf"^({'|'.join(versions())})\n.*$": rf"\1\n{MASKED}",
}
# Of a first run, and of a busy machine.
LEFT_OUT = re.compile(r"^(compiling the simulator.*|.*, about .* left)\n", re.MULTILINE)
# No part of a name or of a version. A plus belongs to the words.
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\.?\w)")


def write_designs(folder: Path) -> None:
    """Write the designs, studies and measurements that the commands are given."""
    write_scene(folder)
    design, study = ((folder / f"{name}.toml").read_text() for name in ("design", "study"))
    many = _with(design, MANY)
    zones = many.replace("[0, 10]\nbox", "[0, 100]\nbox").replace("[chamber]", ZONES + "[chamber]")
    study = _with(study, SEARCH).replace("[0.4, 0.6]", "[2, 8]")
    texts = {
        "many": many,
        "light": _with(design, LIGHT),
        "zones": f'calibration = "{MACHINE.name}"\n{zones}{TOLERANCES}',
        "measured": MEASURED,
        "study": study,
        "pareto": study.replace('name = "uniform_coverage"', PARETO),
    }
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    shutil.copy(DESIGNS / "parts" / "plate.stl", folder)
    shutil.copy(MACHINE, folder)
    plate = (DESIGNS / "plate.toml").read_text("utf-8").replace("parts/plate.stl", "plate.stl")
    plate += "points = 1000\n"
    (folder / "plate.toml").write_text(plate, encoding="utf-8")
    (folder / "brief.toml").write_text(_with(plate, BRIEF), encoding="utf-8")


def _with(text: str, values: dict[str, str]) -> str:
    for key, value in values.items():
        text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
        assert count == 1, key
    return text


def patch_surroundings(patch: pytest.MonkeyPatch, sheets: list[Figure]) -> None:
    """Draw no pictures, work in this process alone, and keep the figures of sheets.

    What is not calibrated is left out: tests/chamberopt/results/test_ranges.py has its words.

    The study of accuracy gets made-up replicas and CPU times: what it advises follows from these.
    """
    patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    patch.setattr("chamberopt.workflows.simulate.simulate_ranges", lambda *_: None)
    patch.setattr("chamberopt.workflows.optimise.study_ranges", lambda *_: None)
    patch.setattr(comparison_folder, "draw_coverage", lambda *_: None)
    patch.setattr(comparison_folder, "draw_difference", lambda *_: None)
    patch.setattr(executor, "local_executor", lambda *_, **__: executor.ThreadExecutor(1))
    patch.setattr(convergence_study, "simulate_timed", made_up_replica)
    patch.setattr(convergence_study, "core_count", lambda: 1)
    still = SimpleNamespace(thread_time=lambda: 0.0, perf_counter=lambda: 0.0)
    patch.setattr(convergence_study, "time", still)
    patch.setattr(timed_replicas, "time", still)
    patch.setattr(convergence_study, "timed_evaluation", lambda *_: (0.5, 0.4, 0.1))
    patch.setattr("chamberopt.cli.teller.compile_with_message", lambda *_: None)

    def save_charts(figure: Figure, *given: Any, **named: Any) -> None:
        if named.get("format") == "svg":  # in a page, as text
            save(figure, *given, **named)
        elif named.get("format") == "pdf":
            sheets.append(figure)

    save = Figure.savefig
    patch.setattr(Figure, "savefig", save_charts)


def make_texts(folder: Path) -> dict[str, str]:
    """Run all commands in a new folder: what they show, by its name in tests/frozen."""
    found: dict[str, str] = {}
    sheets: list[Figure] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch_surroundings(patch, sheets)
        write_designs(folder)
        for kind, commands in COMMANDS.items():
            Path(kind).mkdir()
            found[f"{kind}/terminal.txt"] = "\n".join(map(terminal_text, commands))
            if sheets:
                found[f"{kind}/{SHEET}"] = sheet_text(sheets)
                sheets.clear()
            for path in sorted([*Path(kind).iterdir(), *Path(kind, "out").iterdir()]):
                if text := file_text(path):
                    found[f"{kind}/{path.name}.txt"] = text
    found = {name: masked(text.replace(str(folder), "FOLDER")) for name, text in found.items()}
    for name, text in found.items():
        if name.startswith("pareto/"):  # it has the candidates of the study
            known = set(found.get(name.replace("pareto/", "study/"), "").splitlines())
            found[name] = "".join(f"{line}\n" for line in text.splitlines() if line not in known)
    return found


def terminal_text(command: str) -> str:
    """A command with all that it prints."""
    output, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        status = main(command.split())
    assert status == 0, errors.getvalue()
    return f"$ chamberopt {command}\n{output.getvalue()}--- stderr\n{errors.getvalue()}"


def sheet_text(pages: list[Figure]) -> str:
    """Words of a sheet, however it breaks them into lines."""
    texts = [one for page in pages for axes in page.axes for one in axes.texts]
    words = " ".join(one.get_text() for one in texts)
    return textwrap.fill(masked(words), 100, break_on_hyphens=False) + "\n"


def file_text(path: Path) -> str:
    """A file of a result as text; empty if it is none, or its content is elsewhere too."""
    if path.suffix not in FORMATS or path.as_posix().endswith(COPIES):
        return ""
    text = path.read_text("utf-8")
    if path.suffix == ".json":
        return "".join(f"{line}\n" for line in json_lines(json.loads(text)))
    if path.suffix == ".csv":
        return table_text(text)
    return page_text(text) if path.suffix == ".html" else text


def json_lines(value: Any, name: str = "") -> Iterator[str]:
    """Lines of nested JSON: what holds only plain values on one, later ones alike without keys."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    children = [(str(key), MASKED if key in MASKED_KEYS else one) for key, one in inner]
    if name and not any(isinstance(one, (dict, list)) for _, one in children):
        plain = dict(children) if isinstance(value, dict) else value
        yield f"{name}: {_one_line(plain)}"
        return
    if name:
        yield f"{name}:"
    indent, before = " " * bool(name), None
    for key, one in children:
        keys = _keys(one)
        if not isinstance(one, (dict, list)):
            yield f"{indent}{key}: {_one_line(one)}"
        elif keys and keys == before:
            yield f"{indent}{key}: {_one_line(_without_keys(one))}"
        else:
            yield from (f"{indent}{line}" for line in json_lines(one, key))
        before = keys


def _one_line(value: Any) -> str:
    """JSON on one line, with the first numbers of longer lists."""
    if not isinstance(value, (dict, list)):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_one_line(one)}' for key, one in value.items())}}}"
    is_long = len(value) > ITEMS and all(isinstance(one, (int, float)) for one in value)
    shown = ", ".join(map(_one_line, value[:ITEMS] if is_long else value))
    return f"[{shown}]{f' of {len(value)}' if is_long else ''}"


def _keys(value: Any) -> Any:
    """The keys of a table and of tables in it; None of plain values."""
    if isinstance(value, dict):
        return [(key, _keys(one)) for key, one in value.items() if key not in MASKED_KEYS]
    return None


def _without_keys(value: Any) -> Any:
    if isinstance(value, dict):
        return [_without_keys(one) for key, one in value.items() if key not in MASKED_KEYS]
    return value


def table_text(text: str) -> str:
    """A table without its durations; of long ones the first rows."""
    head, *rows = csv.reader(io.StringIO(text))
    hidden = [name in MASKED_KEYS for name in head]
    shown = rows[:ROWS]
    lines = [",".join(head)]
    for row in shown:
        cells = (MASKED if hide else cell for hide, cell in zip(hidden, row, strict=True))
        lines.append(",".join(cells))
    return "".join(f"{line}\n" for line in [*lines, f"{len(rows)} rows"])


def page_text(text: str) -> str:
    """Text of a page, a line for each piece between two tags."""
    text = re.sub(r"<(script|style)\b.*?</\1>", "", text, flags=re.DOTALL)
    pieces = (" ".join(html.unescape(one).split()) for one in re.split(r"<[^>]*>", text))
    return "".join(f"{one}\n" for one in pieces if one)


def masked(text: str) -> str:
    """A text without what differs from run to run, and with short numbers."""
    text = LEFT_OUT.sub("", text)
    for pattern, word in MASKS.items():
        text = re.sub(pattern, word, text, flags=re.MULTILINE)
    return NUMBER.sub(lambda found: shortened(found[0]), text)


def shortened(number: str) -> str:
    """A number to DIGITS digits, of which zeros stay where there were others."""
    if digits(number) <= DIGITS:
        return number
    value = float(number)
    return f"{value:#.{DIGITS}g}".rstrip(".") if abs(value) > ROUNDING else "0"


def digits(number: str) -> int:
    """Significant digits of a number as it is written."""
    return len(number.partition("e")[0].replace(".", "").lstrip("-0"))


def differences(expected: str, found: str, name: str) -> list[str]:
    """What is wrong with a text: words first, and numbers if the words are right."""
    split = str.split if name.endswith(SHEET) else str.splitlines
    is_rough = name.startswith(ROUGHLY)
    pieces, others = split(expected), split(found)
    if is_rough:  # columns of words move with the width of numbers
        pieces, others = ([" ".join(one.split()) for one in side] for side in (pieces, others))
    words, other_words = ([NUMBER.sub("#", one) for one in side] for side in (pieces, others))
    if words != other_words:
        lines = unified_diff(words, other_words, "expected", "found", n=1, lineterm="")
        return [f"{name}: other words", *lines][:LINES]
    wrong = []
    for number, (one, other) in enumerate(zip(pieces, others, strict=True), 1):
        pairs = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
        if not all((is_near if is_rough else is_same)(*pair) for pair in pairs):
            wrong += [f"{name}:{number}:", f"- {one}", f"+ {other}"]
    return wrong[:LINES]


def is_same(expected: str, found: str) -> bool:
    """Whether two numbers are equal but for rounding, and are written alike."""
    one, other = float(expected), float(found)
    if max(abs(one), abs(other)) < ROUNDING:
        return True
    is_text = digits(expected) < DIGITS and digits(found) < DIGITS
    if is_text and decimals(expected) != decimals(found):
        return False
    return abs(one - other) <= RELATIVE * abs(one)


def is_near(expected: str, found: str) -> bool:
    """Whether two numbers of a calibration are alike."""
    one, other = float(expected), float(found)
    return abs(one - other) <= ROUGH * abs(one) + ROUGH_ABSOLUTE


def decimals(number: str) -> tuple[int, bool]:
    """Digits after the point, and whether there is an exponent."""
    plain, exponent, _ = number.partition("e")
    return len(plain.partition(".")[2]), bool(exponent)


@pytest.fixture(scope="module")
def texts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return make_texts(tmp_path_factory.mktemp("frozen"))


def test_all_that_is_shown_is_frozen(texts: dict[str, str]) -> None:
    assert sorted(texts) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_users_see_what_they_saw(texts: dict[str, str], name: str) -> None:
    wrong = differences((FROZEN / name).read_text("utf-8"), texts[name], name)
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("found", "same"),
    [
        ("time_to_98_s 30.1 ± 0.12 s", True),
        ("time_to_98_s 30.2 ± 0.12 s", False),
        ("time_to_98_s 30.10 ± 0.12 s", False),
        ("time_to_95_s 30.1 ± 0.12 s", False),
        ("time_to_98_s 30.1 ± 0.12 ms", False),
        ("time_to_98_s 30.1 s", False),
        ("time_to_98_s 30.10001 ± 0.12 s", True),
    ],
)
def test_other_words_numbers_and_decimals_are_found(found: str, same: bool) -> None:
    assert (not differences("time_to_98_s 30.1 ± 0.12 s", masked(found), "name")) == same


def write_all() -> None:
    """Write all texts anew."""
    with tempfile.TemporaryDirectory() as folder:
        texts = make_texts(Path(folder).resolve())
    shutil.rmtree(FROZEN, ignore_errors=True)
    for name, text in texts.items():
        path = FROZEN / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_all()
