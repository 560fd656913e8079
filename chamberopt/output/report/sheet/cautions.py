"""What the figures of a process sheet do not hold, in words for a shop, before its warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from chamberopt.chamber.checks.facets import LEFT
from chamberopt.output.report.number_text import interval_text, plain

if TYPE_CHECKING:
    from chamberopt.output.results.load import Result

TIME = "time_to_98_s"


def cautions(result: Result, contents: Mapping[str, Any]) -> Iterator[str]:
    """Sentences on what is simulated otherwise than it is done, and on what is not reached."""
    yield from _time(result, contents)
    if result.design.effects.friction is None:
        yield (
            "Simulated without friction. With it the shot was 22 to 47 % slower in a cylinder (mu "
            "0.1 to 0.5), and coverage takes longer: rely on these times only once the coverage "
            "measured first agrees."
        )
    if any(note.startswith(LEFT) for note in contents["notes"]):
        yield (
            "The part's file has coarse facets in the place of its rounds, which were not divided: "
            "coverage and times are those of the facets."
        )
    if any("without a holder" in note for note in contents["notes"]):
        yield "The part is held in the air: its holder is neither designed nor simulated."
    ends = [note.partition(" = ")[0] for note in contents["notes"] if " lies on its " in note]
    if ends:
        yield (
            f"The search ended on its bounds of {', '.join(ends)}: a better chamber may lie beyond."
        )


def _time(result: Result, contents: Mapping[str, Any]) -> Iterator[str]:
    """Whether the peening time is shorter than what covers the target."""
    time, planned = result.metrics.get(TIME), result.design.process.treatment_time
    if time is None or time.in_words == "not resolved" or time.value <= planned:
        return
    if time.in_words == "never":
        yield "95 % of the target's area is never 98 % covered, however long it is peened."
        return
    row = next(one["result"] for one in contents["metrics"] if one["name"] == TIME)
    needed = time.in_words or f"{interval_text(row)} s"
    yield (
        f"The peening time of {plain(planned)} s is too short: 95 % of the target's area is 98 % "
        f"covered after {needed}."
    )
