"""The command `new`: propose a first design and study for a part."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from chamberopt.cli.console import print_remarks, show
from chamberopt.cli.options import Out, Verbose, app
from chamberopt.common.errors import one_line

if TYPE_CHECKING:
    from chamberopt.chamber.propose.proposal import Proposal
    from chamberopt.chamber.propose.proposed_target import Surface

PICK, USUAL, NONE = "pick", "usual", "none"


@app.command
def new(
    part: Path,
    /,
    *,
    target: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    shape: Literal["cylinder", "box", "prism", "conformal"] | None = None,
    material: str = "",
    shot: str = "",
    ball_mm: float | None = None,
    pose: Literal["standing", "lying", "on-edge"] | None = None,
    shop: Path | None = None,
    intensity: str | None = None,
    coverage: float | None = None,
    calibration: Path | None = None,
    unit: Literal["um", "mm", "cm", "m", "in", "guess"] | None = None,
    pilot: bool = True,
    out: Out = None,
    verbose: Verbose = False,
) -> None:
    """Propose a first design and study for a part, each number with its reason, and a picture.

    Parameters
    ----------
    part
        The part's file: STEP, STL, OBJ, PLY, 3MF, Nastran, Abaqus, Gmsh or VTK.
    target
        What is to be peened: a name of the file, "face N" as the command lists them, "face N.1" for
        the first alone of several alike, or all; may be given several times. pick lists the
        surfaces and asks. By default the likeliest.
    shape
        Form of the chamber; by default a cylinder, or a box for a long part.
    material
        Alloy of the part; `chamberopt materials` lists them.
    shot
        Material of the balls; `chamberopt shot` lists them. By default steel, or tungsten carbide
        where the part is nearly as hard as steel balls.
    ball_mm
        Diameter of a ball; by default the largest in stock that suits the target's fillets and
        slots, and jams in no gap.
    pose
        How the part is held: by its longest size upright, its shortest one, or that between. By
        default its target is evenly exposed; where a long part then takes long, the others are
        tried by pilot runs.
    shop
        A file of the sonotrodes, balls and sizes of chambers that your shop has; nothing else is
        proposed. `chamberopt shop --example` prints one. By default usual sizes.
    intensity
        The Almen intensity that is wanted, in mm: a range such as 0.15-0.20A (A, N or C strips), or
        0.20+-0.02A; or usual, for the alloy and the thickness of the target. Balls that suit the
        target and an amplitude of the sonotrode are chosen for it by pilot runs. By default the
        usual one is aimed at if the alloy is given; none leaves it out.
    coverage
        The coverage that is wanted, in per cent: 100 is the time to 98 %, 200 twice that time.
    calibration
        File of the machine's calibration, from `chamberopt calibrate`. Without one an intensity is
        a rough estimate.
    unit
        Of the numbers in the part's file; by default what the file states. Where it states none and
        several are possible, `new` asks, or stops if nobody can answer; guess takes the likeliest.
    pilot
        Simulate some seconds, so that the treatment time and what is simulated are estimates. It
        takes seconds, and the first time minutes to compile the simulator.
    """
    import chamberopt.pictures.part  # noqa: F401  # imported before the folder is claimed
    from chamberopt.chamber.propose.first_design import propose
    from chamberopt.chamber.propose.left_out import find_left_out
    from chamberopt.chamber.propose.proposal import Wanted
    from chamberopt.chamber.propose.proposed_intensity import (
        as_no_wish,
        is_off,
        usual_for,
        with_expected_intensity,
        with_larger_balls,
        with_thin_places,
    )
    from chamberopt.chamber.propose.quicker import Way, propose_quicker, propose_second_pose
    from chamberopt.chamber.propose.shop import load_shop
    from chamberopt.chamber.propose.text import design_text, study_texts
    from chamberopt.cli.commands.check import draw_target
    from chamberopt.cli.prepare import measured, with_intensity, with_measured_budget
    from chamberopt.common.errors import InputError
    from chamberopt.common.files import claim_folder, whole_or_nothing, write_text
    from chamberopt.common.progress import step
    from chamberopt.common.toml_fields import allowed_range
    from chamberopt.design.intensity import WantedIntensity
    from chamberopt.design.process import Process
    from chamberopt.design.shot import ShotSize
    from chamberopt.documents.proposal import proposal_end
    from chamberopt.geometry.meshes.units import STATED, UnknownUnitError
    from chamberopt.results.vtp_files import pyvista

    _require_file(part)
    low, high = allowed_range(ShotSize.model_fields["diameter_mm"])
    if ball_mm is not None and not low <= ball_mm <= high:
        allowed = f"from {low:g} to {high:g} mm"
        raise InputError(f"--ball-mm: given {ball_mm:g}; allowed: {allowed}")
    low, high = allowed_range(Process.model_fields["coverage_percent"])
    if coverage is not None and not low <= coverage <= high:
        raise InputError(f"--coverage: given {coverage:g}; allowed: from {low:g} to {high:g} %")
    is_usual = intensity == USUAL
    asked = None if intensity in (None, USUAL, NONE) else WantedIntensity.parse(intensity)
    if is_usual and not material:
        raise InputError("--intensity: usual follows from the alloy; give --material")
    if intensity not in (None, NONE) and not pilot:
        raise InputError("--intensity: it takes pilot runs; leave out --no-pilot")
    if PICK in target and not sys.stdin.isatty():
        raise InputError("--target: pick asks, and nobody answers here; give names or faces")

    of_shop = None if shop is None else load_shop(shop)
    wanted = Wanted(
        unit or STATED, shape, material, shot, ball_mm, pose, of_shop, calibration, coverage
    )

    chosen: Sequence[str] = target

    def choose(known: Sequence[Surface]) -> Sequence[str]:
        nonlocal chosen
        chosen = _picked(known) if PICK in target else target
        return chosen

    out = out or Path(part.stem if part.suffix else f"{part.name}_chamber")
    with claim_folder(out):
        pass  # reports a folder that is taken before the work begins
    try:
        made = propose(part, wanted, choose)
    except UnknownUnitError as error:
        if not sys.stdin.isatty():
            raise
        wanted = replace(wanted, unit=_asked_unit(part, error.sizes))
        made = propose(part, wanted, choose)

    def again(other: Wanted) -> Proposal:
        return propose(part, other, lambda _: chosen)

    pyvista()  # before the folder is claimed: Ctrl-C during an import would leave the folder behind
    with claim_folder(out) as folder, whole_or_nothing(folder):
        with step("drawing"):  # before the pilots, so that it can be looked at meanwhile
            draw_target(made.chamber, made.reach, folder / "design.png")
        if pilot:
            drawn = made.chamber
            way = Way(made, wanted, measured(made))
            made, wanted, found = propose_quicker(way, again, lambda one: measured(one, False))
            why_so = {"part.rotate_deg": made.reasons["part.rotate_deg"]}
            # A stated alloy has a usual intensity, which a proposal should not miss.
            seeks = material and intensity is None and found and is_off(made, found.intensity)
            if is_usual or seeks:
                asked = usual_for(made)
            if asked:
                try:
                    made = with_intensity(made, wanted, asked, again)
                except InputError:  # which is no reason to stop if nobody asked
                    if not seeks:
                        raise
                    asked = None
            if asked:
                if wanted.pose != pose:  # by pilots, and not as asked
                    made = replace(made, reasons={**made.reasons, **why_so})
                found = measured(made)
                made = as_no_wish(made) if seeks else made
                pilots = again, lambda one: measured(one, False)
                made = with_larger_balls(made, wanted, asked, found, *pilots)
            elif found is not None:
                made = with_expected_intensity(made, found.intensity)
            made, found = propose_second_pose(made, found, lambda one: measured(one, False))
            made = with_thin_places(made)
            made = with_measured_budget(made, found)
            if made.chamber is not drawn:
                with step("drawing"):
                    draw_target(made.chamber, made.reach, folder / "design.png")
        left_out = find_left_out(made)
        write_text(folder / "design.toml", design_text(made, folder, left_out))
        studies = study_texts(made, "design.toml")
        for name, text in studies.items():
            write_text(folder / name, text)
    show(proposal_end(made, left_out, verbose))
    print_remarks(f"note: {one_line(text)}" for text in made.mesh.notes)
    print_remarks(f"warning: {text}" for text in made.warnings)
    show(
        [f"design in {folder / 'design.toml'}", *(f"study in {folder / name}" for name in studies)]
    )


def _require_file(part: Path) -> None:
    """Raise InputError unless the part is a plain file whose name can stand in a design file."""
    from chamberopt.common.errors import InputError

    if not part.is_file():
        what = "is a folder" if part.is_dir() else "is no plain file"
        what = what if part.exists() else "no such file"
        raise InputError(f"{part}: {what}; give the file of the part, from CAD or a scanner")
    try:
        str(part.resolve()).encode()
    except UnicodeEncodeError:
        text = "its path is not UTF-8, so that no design can name it; rename the file or its folder"
        raise InputError(f"{part}: {text}") from None


def _asked_unit(part: Path, sizes: Mapping[str, str]) -> str:
    """Ask the user in which unit the numbers of the part's file are, and return it.

    Args:
        sizes: the size that the part would have, by unit.
    """
    from chamberopt.common.errors import InputError

    show([f"{part} does not state the unit of its numbers. The part measures"])
    show([f"  {size} if they are in {unit}" for unit, size in sizes.items()])
    try:
        answer = input(f"unit ({', '.join(sizes)}): ").strip().lower()
    except EOFError:
        answer = ""
    if answer not in sizes:
        text = f"given {answer!r}" if answer else "got no answer"
        raise InputError(f"--unit: {text}; give one of {', '.join(sizes)}")
    return answer


def _picked(known: Sequence[Surface]) -> Sequence[str]:
    """Ask the user which of the part's surfaces are to be peened, and return their names."""
    from chamberopt.common.errors import InputError
    from chamberopt.documents.proposal import surface_lines

    show(surface_lines(known, len(known)))
    try:
        answer = input("to be peened, separated by commas: ").strip()
    except EOFError:
        raise InputError("--target: pick got no answer; answer, or give names or faces") from None
    if any(one.name == answer for one in known):  # a single name with commas
        return [answer]
    return [name.strip() for name in answer.split(",") if name.strip()]
