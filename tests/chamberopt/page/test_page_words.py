"""Messages in the words of the page, and what they offer to take."""

import ast
import re
from pathlib import Path

import pytest

import chamberopt
from chamberopt.page.page_words import (
    TERMS,
    amplitudes_named,
    balls_named,
    explained,
    names_met,
    on_page,
)


@pytest.mark.parametrize(
    ("matter", "balls", "amplitudes"),
    [
        ("MANY BALLS, to be dosed and sorted: 0.7 mm would suit 80%", [0.7], []),
        ("LARGER BALLS: they suit 60%, and 1 mm would suit 90%, with about 0.2 mmA "
         "(--ball-mm 1 takes these)", [1.0], []),
        ("NOT IN THE RANGE: it takes an amplitude of about 55 µm zero-to-peak, or balls of about "
         "1.3 mm, larger than are proposed here", [1.3], [55.0]),
        ("BALLS JAM in gaps of 0.43 mm, as every size does", [], []),
    ],
)  # fmt: skip
def test_balls_and_amplitudes_are_those_that_would_serve(
    matter: str, balls: list[float], amplitudes: list[float]
) -> None:
    assert balls_named(matter) == balls
    assert amplitudes_named(matter) == amplitudes


def test_surfaces_that_are_met_are_those_of_the_matter() -> None:
    begin, end = "NOT MASKED: the shot also meets ", "; what has to keep its size takes a mask"
    assert names_met(f"{begin}WEB (80 mm²), the rest of RIM 2 (3 mm² of it){end}") == [
        "WEB", "RIM 2",
    ]  # fmt: skip
    assert names_met(f"{begin}WEB (80 mm²) and 3 more{end}") == []  # not all are named
    assert names_met("BALLS JAM in gaps of 0.43 mm (2), as every size does; ask") == []


def test_a_term_has_its_meaning_where_it_stands_first() -> None:
    words = on_page(
        "expected 0.06 mmA, within a factor of 2.5 by 10 replicas; raise process.accuracy.replicas"
    )
    assert words[1] == ("within a factor of", TERMS["within a factor of"])
    assert words[3] == ("replicas", TERMS["replicas"])
    assert words[5] == ("replicas of the accuracy of the process", "process.accuracy.replicas")
    assert on_page("v0_m_s of C0, then C0 again")[1:] == [
        ("C0", TERMS["C0"]), ", then C0 again",
    ]  # fmt: skip


def test_a_command_is_named_as_the_page_has_it() -> None:
    found = on_page("chamberopt simulate predicts it; “chamberopt check --pilot” tells more")
    assert found == [
        ("Simulate, in the tab Run", "chamberopt simulate"),
        " predicts it; “",
        ("a check with pilot runs, in a terminal", "chamberopt check --pilot"),
        "” tells more",
    ]


@pytest.mark.parametrize(
    ("printed", "told"),
    [
        ("finishing what runs, then stopping; press Ctrl-C again to stop now",
         "finishing what runs, then stopping"),
        ("to resume: chamberopt run fast.toml --out results/fast", ""),
        ("results/fast: not finished; to resume it: chamberopt run fast.toml",
         "results/fast: not finished"),
        ("simulated at both ends (2 times the work); --no-ranges leaves them out",
         "simulated at both ends (2 times the work)"),
        ("and 3 more notes: --verbose shows all",
         "and 3 more notes, below its figures in the tab Results"),
        ("8 mm from the sonotrode as the middle of the target is: chamberopt strip --distance-mm 8",
         "8 mm from the sonotrode as the middle of the target is"),
        ("there is room for --disc-mm 16.9 or --size-mm 16.4 4: give a size, or use --at ZONE",
         "there is room for a disc of 16.9 mm or a strip of 16.4 x 4 mm: give a size"),
        ("give them a zone of their own (docs/how_to/drawing.md)", "give them a zone of their own"),
    ],
)  # fmt: skip
def test_what_only_a_terminal_needs_is_left_out(printed: str, told: str) -> None:
    assert on_page(printed) == ([told] if told else [])


def test_what_only_the_file_can_is_said_as_that() -> None:
    words = "leave out of it, in the file, what no ball can touch"
    found = on_page("narrow part.target, or set part.target.reachable = true")
    assert found[-1] == (words, "set part.target.reachable = true")


def test_commands_in_html_are_named_as_the_page_has_them() -> None:
    found = explained("<p>1 &lt; 2: chamberopt calibrate</p><pre>chamberopt calibrate</pre>")
    tip = '<abbr title="chamberopt calibrate">a calibration of the machine, in a terminal</abbr>'
    assert found == f"<p>1 &lt; 2: {tip}</p><pre>chamberopt calibrate</pre>"


def test_terms_in_html_are_explained_outside_tags_and_drawings() -> None:
    text = '<p class="C0">C0, and C0</p><svg><text>v0</text></svg>'
    tip = f'<abbr title="{TERMS["C0"]}">C0</abbr>'
    assert explained(text) == f'<p class="C0">{tip}, and C0</p><svg><text>v0</text></svg>'


def test_no_message_of_the_program_names_a_command_on_the_page() -> None:
    package = Path(chamberopt.__file__).parent
    commands = "|".join(one.stem for one in (package / "cli" / "commands").glob("[a-z]*.py"))
    named = re.compile(rf"chamberopt (?:{commands}|run|shot|shop|materials)\b")
    for file in package.rglob("*.py"):
        if file.relative_to(package).parts[0] in ("cli", "page"):
            continue
        tree = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        nodes = [one for one in tree if not isinstance(one, ast.Expr)]  # docstrings
        texts = [kid.value for one in nodes for kid in ast.iter_child_nodes(one)
                 if isinstance(kid, ast.Constant) and isinstance(kid.value, str)]  # fmt: skip
        for text in texts:
            shown = "".join(one if isinstance(one, str) else one[0] for one in on_page(text))
            assert not named.search(shown), file.name
