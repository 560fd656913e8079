"""The hard cases and the result of each.

    python benchmarks/hard_cases.py [--json] [--long] [--cases WORD ...]

The table gives collisions, events a simulated second, worst overlap and energy drift. The cases and
what physics expects of them are in tests/hard_cases. A case that needs what the simulator does not
have yet is listed as "not supported yet", never as ok. The benchmark needs what the tests need: pip
install -e '.[test]'.
"""

import argparse
import json
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.hard_cases.cases import CASES
from tests.hard_cases.cases.tested import CASES as TESTED
from tests.hard_cases.outcome import Case, Outcome

NOT_YET = "not supported yet: it needs balls that can lie still"


def chosen(words: list[str], with_long: bool) -> list[Case]:
    """The cases with one of the words in their names, all if there are none."""
    return [
        case
        for case in [*CASES, *TESTED]
        if (with_long or not case.long) and (not words or any(word in case.name for word in words))
    ]


def row(case: Case) -> dict[str, Any]:
    """The outcome as a row of the table.

    ``ok`` is None where the simulator does not support the case.
    """
    if not case.supported:
        return {**asdict(Outcome(case.name, False, NOT_YET)), "ok": None}
    return asdict(case.outcome())


def line(row: dict[str, Any], wide: int) -> str:
    """One line of the table; a dash where there was nothing to measure."""
    verdict = {True: "ok", False: "WRONG", None: "-"}[row["ok"]]
    numbers = [
        f"{row['collisions']:>10}" if row["collisions"] else f"{'-':>10}",
        *(
            f"{row[name]:>11.2e}"
            if row[name] and math.isfinite(row[name])
            else f"{_none(row[name]):>11}"
            for name in ("events_per_s", "penetration", "energy_drift")
        ),
    ]
    return f"{row['case']:{wide}} {' '.join(numbers)}  {verdict:5} {row['said']}"


def _none(value: float) -> str:
    return "0" if value == 0.0 else "-"


def plain(row: dict[str, Any]) -> dict[str, Any]:
    """The same for JSON, which has neither NaN nor infinity."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in row.items()
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument(
        "--long", action="store_true", help="with the case of 10^8 collisions: minutes"
    )
    parser.add_argument(
        "--cases",
        nargs="*",
        default=[],
        metavar="WORD",
        help="only cases with a word in their names",
    )
    options = parser.parse_args()
    cases = chosen(options.cases, options.long)
    wide = max((len(case.name) for case in cases), default=0)
    if not options.json:
        print(f"{'case':{wide}} collisions  events / s   overlap m      drift  outcome")
    rows = []
    for case in cases:
        rows.append(row(case))
        if not options.json:
            print(line(rows[-1], wide), flush=True)
    if options.json:
        print(json.dumps([plain(one) for one in rows], indent=1))
    return int(any(one["ok"] is False for one in rows))


if __name__ == "__main__":
    sys.exit(main())
