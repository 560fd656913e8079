"""The command `check`: show the content of a design or study, and the physical effects it needs."""

from __future__ import annotations

import json as json_format
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.cli.console import print_json, print_remarks, show
from chamberopt.cli.options import Json, Out, Verbose, app
from chamberopt.cli.prepare import advise_effects

if TYPE_CHECKING:
    from chamberopt.design.design import Design


@app.command
def check(
    file: Path,
    /,
    *,
    pilot: bool = False,
    screenshot: Path | None = None,
    json: Json = False,
    out: Out = None,
    verbose: Verbose = False,
) -> None:
    """Check a design or study file: geometry, volumes, shot, warnings, and the effects it needs.

    Dimensionless groups say which effects may matter; pilot runs measure it.

    Parameters
    ----------
    file
        Design or study file (.toml).
    pilot
        Simulate with each effect switched on and off, to measure what it changes. Each set of
        effects must be compiled once, for up to a minute.
    screenshot
        Write an image (.png) of the part with its target and chamber, or of the surface's faults.
    """
    from chamberopt.common.files import claim_file, claim_folder, whole_or_nothing

    with ExitStack() as claims:
        if screenshot is not None:
            from chamberopt.pictures.subprocess_drawing import picture_path

            claims.enter_context(claim_file(picture_path(screenshot)))
        if out is not None:
            claims.enter_context(whole_or_nothing(claims.enter_context(claim_folder(out))))
        _check(file, pilot, screenshot, json, out, verbose)


def _check(
    file: Path, pilot: bool, screenshot: Path | None, json: bool, out: Path | None, verbose: bool
) -> None:
    from chamberopt.chamber.build import build_chamber
    from chamberopt.chamber.checks.facts import describe, first_facts
    from chamberopt.cli.facts import table_lines
    from chamberopt.common.files import write_text
    from chamberopt.common.progress import step
    from chamberopt.documents.facts import facts_lines
    from chamberopt.documents.terminal_lines import note_lines
    from chamberopt.geometry.meshes.surface_error import SurfaceError
    from chamberopt.pictures.part import draw_target
    from chamberopt.results.vtp_files import write_chamber
    from chamberopt.search.study import Study, load
    from chamberopt.search.study.parameters import setting
    from chamberopt.simulation.effect_pilot import groups

    loaded = load(file)
    kind, design = ("study", loaded.design) if isinstance(loaded, Study) else ("design", loaded)
    try:
        with step("building the chamber"):
            chamber = build_chamber(design)
    except SurfaceError as error:
        if screenshot is not None:  # draws the faults in red; the message follows on stderr
            from chamberopt.pictures.part import draw_part

            with step("drawing"):
                remark = draw_part(error.corners, str(error), screenshot, edges=error.edges)
            print_remarks([remark or f"picture in {screenshot}"])
            error.__notes__.clear()  # the notes tell how to see the faults
        raise

    def lines_of(facts: Mapping[str, Any]) -> list[str]:
        return table_lines(facts) if verbose else facts_lines(design, facts)

    first_lines = lines_of(first_facts(design, chamber))
    if not json:
        show(first_lines)  # the other facts take longer, above all the first time
    with step("finding what the shot reaches"):
        facts = describe(design, chamber)
    facts["warnings"] = [one.text for one in facts["warnings"]]
    if screenshot is not None:
        with step("drawing"):
            print_remarks([draw_target(design, chamber, screenshot)])
    if isinstance(loaded, Study):
        facts["vary"] = {
            name: {"values": list(varied.texts), "start": setting(design, name)}
            if varied.texts
            else {"low": varied.bounds[0], "start": setting(design, name), "high": varied.bounds[1]}
            for name, varied in loaded.vary.items()
        }
        facts["evaluations"] = loaded.optimizer.evaluations
    if not json:
        show(line for line in lines_of(facts) if line not in first_lines)
        if not verbose:
            show(["", *(f"warning: {text}" for text in facts["warnings"])])
            show([*note_lines(facts["notes"], verbose), ""])
    facts["effects"] = advise_effects(design, chamber) if pilot else groups(design, chamber)
    if not json:
        show(f"effect: {one['said']}" for one in facts["effects"])
        show([f"{file}: {_use_in_words(kind, design)}"])
    if out is not None:
        write_text(out / "check.json", json_format.dumps(facts, indent=2) + "\n")
        write_chamber(out, chamber)
        if not json:
            show([f"results in {out}"])
    if json:
        print_json(facts if out is None else {**facts, "folder": str(out)})


def _use_in_words(kind: str, design: Design) -> str:
    """Return in words what a checked design or study is good for.

    Args:
        kind: "design" or "study".
    """
    from chamberopt.chamber.matters import Urgency, matter_of

    urgencies = [matter_of(one).urgency for one in design.to_settle]
    count = urgencies.count(Urgency.BEFORE_BUILDING)
    if not count:
        return f"a usable {kind}"
    are = "matters are" if count > 1 else "matter is"
    return f"a {kind} that can be simulated, but {count} {are} to be settled before it is built"
