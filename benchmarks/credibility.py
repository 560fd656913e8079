"""Level of evidence for each factor of credibility, and what the evidence covers: typed, checked.

    python -m benchmarks.credibility            print the tables; exit status 1 if a piece of
                                                evidence (file, section, test, command) is not there
    python -m benchmarks.credibility --write    also put them into docs/explanation/credibility.md,
                                                with those of saturation_sets and drift

Factors are those of NASA-STD-7009B, its Appendix E, by their names as public text quotes them;
levels are 0 to 4. Neither the standard's own wording of the levels nor ASME V&V 40 was read: what
a level means here stands in LEVELS. That each piece of evidence exists is checked, not that it
convinces.
"""

import argparse
import ast
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks import drift, saturation_sets
from benchmarks.validation import CASES, stored

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "explanation" / "credibility.md"

LEVELS = {
    0: "insufficient evidence",
    1: "argued from published or general knowledge, or shown on something else than the machine",
    2: "shown and quantified on parts of the problem, by a command that anybody can run",
    3: "shown and quantified for all of the intended use, and tested for being still so",
    4: "shown on the real machine, over the whole range in which it is used",
}


@dataclass(frozen=True)
class Page:
    """A page of docs/, or a section of it."""

    path: str
    section: str = ""

    def problem(self) -> str:
        if not (ROOT / "docs" / self.path).is_file():
            return f"docs/{self.path}: no such page"
        text = (ROOT / "docs" / self.path).read_text(encoding="utf-8")
        found = self.section in re.findall(r"(?m)^#+ (.*)$", text)
        return "" if found or not self.section else f"docs/{self.path}: no section {self.section}"

    def __str__(self) -> str:
        name, anchor = Path(self.path).name, ""
        if self.section:
            anchor = "#" + re.sub(r"[^\w\- ]", "", self.section.lower()).replace(" ", "-")
            name = f"{Path(self.path).stem}, {self.section}"
        folder, _, file = self.path.rpartition("/")
        return f"[{name}]({'' if folder == 'explanation' else f'../{folder}/'}{file}{anchor})"


@dataclass(frozen=True)
class Suite:
    """A file or folder of tests, or one of its functions."""

    path: str
    name: str = ""

    def problem(self) -> str:
        path = ROOT / "tests" / self.path
        if not path.exists():
            return f"tests/{self.path}: no such tests"
        if self.name and self.name not in _functions(path):
            return f"tests/{self.path}: no test {self.name}"
        return ""

    def __str__(self) -> str:
        return f"`tests/{self.path}`"


@dataclass(frozen=True)
class Benchmark:
    """A module of benchmarks/ that is run, with the file of results that it left, if any."""

    name: str
    results: str = ""

    def problem(self) -> str:
        path = ROOT / "benchmarks" / f"{self.name}.py"
        if not path.is_file() or "main" not in _functions(path):
            return f"benchmarks/{self.name}.py: no such command"
        if self.results and not (ROOT / "benchmarks" / "results" / self.results).is_file():
            return f"benchmarks/results/{self.results}: no such results"
        return ""

    def __str__(self) -> str:
        return f"`python -m benchmarks.{self.name}`"


@dataclass(frozen=True)
class Command:
    """A command of chamberopt, with options."""

    words: str

    def problem(self) -> str:
        from chamberopt.cli import commands  # noqa: F401  # registers every command
        from chamberopt.cli.options import app

        name, *options = self.words.split()
        if name not in app:
            return f"chamberopt {self.words}: no such command"
        names = {
            one for argument in app[name].assemble_argument_collection() for one in argument.names
        }
        missing = [one for one in options if one.startswith("--") and one not in names]
        return f"chamberopt {name}: no option {missing[0]}" if missing else ""

    def __str__(self) -> str:
        return f"`chamberopt {self.words}`"


@dataclass(frozen=True)
class File:
    """A file of the repository, and a text that is in it."""

    path: str
    text: str = ""

    def problem(self) -> str:
        path = ROOT / self.path
        if not path.is_file():
            return f"{self.path}: no such file"
        found = self.text in path.read_text(encoding="utf-8")
        return "" if found else f"{self.path}: has no {self.text!r}"

    def __str__(self) -> str:
        return f"`{self.path}`"


Evidence = Page | Suite | Benchmark | Command | File


@dataclass(frozen=True)
class Factor:
    """A factor of credibility: the level that is claimed, why, and what the next level needs."""

    name: str
    level: int
    why: str
    evidence: tuple[Evidence, ...]
    next_level: str


@dataclass(frozen=True)
class Bound:
    """What the evidence covers of a quantity, and what the program says beyond it."""

    quantity: str
    covered: str
    evidence: tuple[Evidence, ...]
    said: str  # what the program says, or that it says nothing
    check: File | None = None  # where it does


FACTORS = (
    Factor(
        "Data pedigree", 1,
        "Each number of the catalogue says what it was read in, or that it is by heart. "
        "Restitution follows "
        "from a formula, and was measured for no ball of the catalogue.",
        (File("chamberopt/design/materials/alloys.toml", "by heart"), Command("materials"),
         Benchmark("stress_profiles")),
        "restitution of the shop's own balls on its sonotrode, walls and part, at 1 to 15 m/s",
    ),
    Factor(
        "Verification", 3,
        "Closed forms, conserved quantities, another program, seeded faults, other meshes of one "
        "part, the same "
        "bits on any number of workers.",
        (Page("explanation/validation.md"), Benchmark("split_invariance", "split_invariance.csv"),
         Benchmark("facet_invariance", "facet_invariance.csv"), Benchmark("mutants"),
         Suite("sim_core"), Suite("hard_cases")),
        "somebody who did not write the program",
    ),
    Factor(
        "Validation", 1,
        "Granular gases and single rebounds agree with what was published. Of a peening machine "
        "only an exponent "
        "of the intensity could be compared. None of the cases was blind.",
        (Page("explanation/validation.md", "What is not reproduced, and why"),
         Benchmark("validation", "validation_strips.csv")),
        "one machine, predicted blind and measured: "
        "[blind_prediction.md](../how_to/blind_prediction.md)",
    ),
    Factor(
        "Development technical review", 0,
        "No review by others is on record.", (),
        "a review with findings and answers, kept with the sources",
    ),
    Factor(
        "Development process and product management", 2,
        "History of all changes, tests before each, locked dependencies, figures kept from "
        "version to version.",
        (File("CHANGELOG.md", "figures change"), File(".ci/run", "pytest"),
         File("requirements.lock", "sha256"),
         Benchmark("drift", "drift.csv"), Suite("test_architecture.py")),
        "releases that are tagged, each with its drift table and the long tests passed",
    ),
    Factor(
        "Use assessment", 2,
        "The program says where a design lies beyond what is covered, in `check`, on the sheet "
        "in red, and in notes. "
        "The envelope is that of the evidence, not of machines.",
        (Command("check"), Suite("chamberopt/printers/test_sheet.py",
         "test_what_forbids_to_use_it_is_in_red")),
        "an envelope from measured machines",
    ),
    Factor(
        "Input pedigree", 1,
        "Uncalibrated, inputs are a catalogue's. With a calibration they are measured, with "
        "errors: level 2 for "
        "that design.",
        (Page("explanation/calibration.md"), Command("calibrate")),
        "calibrate, and keep measurements and machine.toml with the sheet",
    ),
    Factor(
        "Uncertainty characterization", 2,
        "Intervals were held against truth and held; ranges of what is unknown and tolerances "
        "are simulated; a "
        "calibration's errors are carried. The error of the model's form is in none of them.",
        (Benchmark("interval_calibration", "intervals_stopping.csv"),
         Benchmark("coverage_calibration", "coverage_calibration.csv"),
         Benchmark("synthetic_shops", "synthetic_shops.csv"), Benchmark("ranges", "ranges.csv"),
         Command("simulate --tolerances"), Suite("chamberopt/coverage/test_coverage_intervals.py")),
        "the model's error from measured machines, in the intervals",
    ),
    Factor(
        "Results robustness", 2,
        "What each unknown number does to a figure is simulated; which conclusions survive "
        "friction was looked at "
        "for chambers of three parts.",
        (Page("explanation/friction.md", "Which conclusions of a study survive"),
         Benchmark("friction_ranking", "friction_ranking_gear.csv"),
         Benchmark("response_steps", "response_steps.csv")),
        "the same for all unknowns, on parts of users",
    ),
    Factor(
        "Use and analysis technical review", 0,
        "It is the user's: the sheet has fields for who checked it.",
        (Command("report --sheet --revision"),),
        "a second engineer who repeats the result from its folder",
    ),
    Factor(
        "Use process and product management", 2,
        "A result is data with digests; sheet and report name version, seed and digests; what "
        "requalifies is "
        "printed.",
        (Page("reference/trust.md"), Suite("chamberopt/cli/test_moved_results.py"),
         Suite("chamberopt/printers/test_sheet.py",
              "test_an_auditor_finds_version_digests_revision_and_what_requalifies")),
        "the shop's own control of designs and sheets",
    ),
    Factor(
        "Use history (of revision A)", 0,
        "No use in production is on record.", (),
        "parts that were designed with it, measured, and reported",
    ),
)  # fmt: skip

BOUNDS = (
    Bound("diameter of the balls", "3 mm against another program; others by "
    "dimensional analysis alone",
          (Benchmark("validation", "validation_strips.csv"),),
          "warns beyond 1.5 times what a calibration was made with",
          File("chamberopt/chamber/checks/calibration.py", "more than a factor of 1.5")),
    Bound("amplitude", "25 to 40 µm zero-to-peak: one exponent of the intensity; no machine's "
    "figures",
          (Page("explanation/validation.md", "What is not reproduced, and why"),),
          "warns more than 30 % beyond what a calibration was made at",
          File("chamberopt/chamber/checks/calibration.py", "than 30 % from this design's")),
    Bound("number of balls", "30 to 200 against another program; up to thousands by the same laws",
          (Benchmark("validation", "validation_soft_spheres.csv"),),
          "warns above a filling of 20 %",
          File("chamberopt/chamber/checks/check.py", "they hinder each other")),
    Bound("material of the balls", "steel; others by their density and elasticity alone",
     (Command("materials"),),
          "warns of a material that a calibration was not made with",
          File("chamberopt/chamber/checks/calibration.py", "another material has other constants")),
    Bound("metal of the part", "hardness alone for dents; residual stress not for strongly "
    "hardening metals",
          (Page("explanation/residual_stress.md"),),
          "refuses residual stress of such metals",
          File("chamberopt/coverage/stress_knowledge.py", "hardens_strongly")),
    Bound("dents", "strips: of about a tenth of the ball's diameter; residual stress: up to .4",
          (Page("explanation/residual_stress.md"),),
          "gives no residual stress beyond .4; says nothing of strips",
          File("chamberopt/coverage/stress_knowledge.py", "WIDEST_DENT = 0.4")),
    Bound("shape of the chamber", "cylinders against exact surfaces; other shapes "
    "by other meshes",
          (Benchmark("analytic", "analytic.csv"), Benchmark("facet_invariance",
           "facet_invariance.csv")),
          "warns of coarse facets, of gaps where balls jam, and of what no ball reaches",
          File("chamberopt/chamber/checks/fillets.py", "coarse facets")),
    Bound("fillets and slots", "shot of half of a fillet's radius and a quarter of a slot's "
    "width (ASTM B851, by a "
          "quotation)", (Page("how_to/drawing.md"),),
          "warns of larger shot", File("chamberopt/chamber/checks/fillets.py", "use smaller "
          "balls")),
    Bound("numbers of dents", "3 a window for means, 25 for single places",
          (Page("explanation/accuracy.md", "How many dents it takes"),),
          "gives no interval: not resolved",
          File("chamberopt/simulation/estimates.py", "not_known(NOT_RESOLVED)")),
    Bound("wear, temperature, air that streams, broken balls", "not simulated",
          (Page("reference/physics.md", "What is left out"),), "says nothing", None),
)  # fmt: skip

KNOWN_WRONGS = (
    ("Contacts take no time: in a program whose contacts take 8 µs, as of steel balls of 3 mm, the "
    "balls are 1 to 8 % slower.",
     Page("explanation/validation.md", "Soft spheres: another program")),
    ("Restitution at 5 to 15 m/s is a formula's; mean speeds go with the amplitude to the power "
    "0.7 to 1 by it.",
     Page("explanation/validation.md", "What is not reproduced, and why")),
    ("Saturation times by a shop's fits are off by -36 to +15 %; intensities by -1 to +3 %.",
     Page("explanation/peening.md", "Arc height of a virtual strip")),
    ("The depth of compression is a sixth too small on the mean of seven profiles, all of air "
    "blast.",
     Page("explanation/residual_stress.md")),
    ("Strengths of dents grow faster with the amplitude than the stress layer: not both are right.",
     Page("explanation/residual_stress.md")),
    ("The one published experiment is reproduced only with a fitted amplitude of 4.78 µm: with the "
    "25 to 40 µm to which machines are set, this chamber is covered over 99 %, not to 39 %. The "
    "paper leaves amplitude, diameter and restitution open.",
     Page("explanation/analytic.md")),
    ("Perfectly smooth parallel faces let a ball hop on one spot for ever.",
     Page("explanation/validation.md", "What is not reproduced, and why")),
)  # fmt: skip


def _functions(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {one.name for one in tree.body if isinstance(one, ast.FunctionDef)}


def problems() -> Iterator[str]:
    """Yield what is wrong: evidence that is not there, and levels above 1 without any."""
    for factor in FACTORS:
        if factor.level not in LEVELS:
            yield f"{factor.name}: no level {factor.level}"
        if factor.level > 0 and not factor.evidence:
            yield f"{factor.name}: level {factor.level} without evidence"
        yield from _missing(factor.name, factor.evidence)
    for bound in BOUNDS:
        yield from _missing(bound.quantity, bound.evidence)
        yield from _missing(bound.quantity, (bound.check,) if bound.check else ())
    for text, page in KNOWN_WRONGS:
        yield from _missing(text, (page,))


def _missing(name: str, evidence: Sequence[Evidence]) -> Iterator[str]:
    yield from (f"{name}: {text}" for one in evidence if (text := one.problem()))


def factor_table() -> str:
    lines = ["| factor | level | why | evidence | the next level needs |", "|---|--:|---|---|---|"]
    for one in FACTORS:
        shown = ", ".join(map(str, one.evidence)) or "none"
        lines.append(f"| {one.name} | {one.level} | {one.why} | {shown} | {one.next_level} |")
    return "\n".join(lines)


def bound_table() -> str:
    lines = ["| quantity | covered | by | beyond it the program |", "|---|---|---|---|"]
    for one in BOUNDS:
        shown = ", ".join(map(str, one.evidence))
        lines.append(f"| {one.quantity} | {one.covered} | {shown} | {one.said} |")
    return "\n".join(lines)


def wrong_list() -> str:
    lines = [f"- {text} {page}" for text, page in KNOWN_WRONGS]
    rows = {name: stored(name) for name in CASES}
    told = [f"{sum(row.agrees is False for row in found)} of {name}" for name, found in rows.items()
            if any(row.agrees is False for row in found)]  # fmt: skip
    judged = sum(row.agrees is not None for found in rows.values() for row in found)
    wrong = sum(row.agrees is False for found in rows.values() for row in found)
    page = Page("explanation/validation.md")
    rows_text = f"{wrong} of {judged} rows of {page} that have a reference do not agree"
    lines.append(f"- {rows_text}: {', '.join(told)}.")
    return "\n".join(lines)


def level_table() -> str:
    return "\n".join(["| level | means here |", "|--:|---|",
                      *(f"| {level} | {text} |" for level, text in LEVELS.items())])  # fmt: skip


def saturation_table() -> str:
    rows = [saturation_sets.row(one) for one in saturation_sets.read_sets(saturation_sets.SHIPPED)]
    lines = [f"| {' | '.join(rows[0])} |", f"|---|{'--:|' * (len(rows[0]) - 1)}"]
    return "\n".join([*lines, *(f"| {' | '.join(map(str, row.values()))} |" for row in rows)])


def drift_table() -> str:
    rows = drift.read()
    return f"{drift.table(rows)}\n\n{drift.reasons(rows)}"


TABLES = {
    "levels": level_table,
    "factors": factor_table,
    "bounds": bound_table,
    "wrongs": wrong_list,
    "saturation": saturation_table,
    "drift": drift_table,
}
OWN = ("levels", "factors", "bounds", "wrongs")  # printed by this command


def with_tables(page: str) -> str:
    """Return the page with each table between its marks renewed."""
    for name, table in TABLES.items():
        begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
        head, found, rest = page.partition(begin)
        if not found or end not in rest:
            raise ValueError(f"{PAGE}: no marks {begin} and {end}")
        page = f"{head}{begin}\n\n{table()}\n\n{end}{rest.partition(end)[2]}"
    return page


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="put the tables into the page")
    options = parser.parse_args(arguments)
    print("\n\n".join(TABLES[name]() for name in OWN))
    found = list(problems())
    for text in found:
        print(f"error: {text}", file=sys.stderr)
    if options.write and not found:
        PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
