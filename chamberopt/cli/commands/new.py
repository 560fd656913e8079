"""The command `new`: propose a first design and study for a part."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from chamberopt.cli.console import print_json, print_remarks, show
from chamberopt.cli.options import Json, Out, Verbose, app
from chamberopt.common.errors import one_line

if TYPE_CHECKING:
    from chamberopt.chamber.layout.target import Surface
    from chamberopt.chamber.propose.proposal import Proposal

PICK = "pick"  # in the place of names of surfaces


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
    pose: Literal["standing", "lying", "on-edge", "turning"] | None = None,
    shop: Path | None = None,
    intensity: str | None = None,
    coverage: float | None = None,
    calibration: Path | None = None,
    unit: Literal["um", "mm", "cm", "m", "in", "guess"] | None = None,
    pilot: bool = True,
    json: Json = False,
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
        How the part is held: by its longest size upright, its shortest one, or that between, or
        turning about a level axis round which its target goes. By default its target is evenly
        exposed; where a part then takes long, the others are tried by pilot runs.
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
    from chamberopt.chamber.propose.first_design import propose
    from chamberopt.chamber.propose.proposal import Wanted
    from chamberopt.chamber.propose.proposed_mask import find_left_out
    from chamberopt.chamber.propose.text import is_to_be_settled
    from chamberopt.chamber.shop import load_shop
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.errors import InputError
    from chamberopt.common.files import claim_folder
    from chamberopt.common.progress import tell_program
    from chamberopt.documents.proposal import proposal_in_words, proposal_lines
    from chamberopt.geometry.meshes.surface_error import SurfaceError
    from chamberopt.geometry.meshes.units import STATED, UnknownUnitError
    from chamberopt.printers.terminal import text
    from chamberopt.workflows.propose import (
        DESIGN,
        SIZES,
        Wishes,
        require_file,
        stages,
        write_proposal,
    )

    require_file(part)
    if PICK in target and not sys.stdin.isatty():
        raise InputError("--target: pick asks, and nobody answers here; give names or faces")
    of_shop = None if shop is None else load_shop(shop)
    wanted = Wanted(
        unit or STATED, shape, material, shot, ball_mm, pose, of_shop, calibration, coverage
    )
    wishes = Wishes(wanted, intensity, pilot)
    wishes.require_possible()

    picked: list[Sequence[str]] = []

    def choose(known: Sequence[Surface]) -> Sequence[str]:
        if PICK not in target:
            return target
        if not picked:  # asked once, however many designs are tried
            picked.append(_picked(known))
        return picked[0]

    def first_proposal() -> Proposal:
        try:
            return propose(part, wanted, choose)
        except SurfaceError as error:
            error.__notes__.clear()  # they tell how to see the faults by a design, which is not yet
            raise

    out = out or Path(part.stem if part.suffix else f"{part.name}_chamber")
    with claim_folder(out):
        pass  # reports a folder that is taken before the work begins
    teller = TerminalTeller()
    try:
        with stages(teller, pilot) as begin:
            if PICK not in target:  # which asks below the lines of steps
                begin(SIZES)
            made = first_proposal()
    except UnknownUnitError as error:
        if not sys.stdin.isatty():
            raise
        wanted = replace(wanted, unit=_asked_unit(part, error.sizes))
        wishes = replace(wishes, geometry=wanted)
        made = first_proposal()

    if pilot:  # which take minutes, and may change it

        def draft() -> dict[str, object]:
            first = proposal_in_words(made, find_left_out(made))
            return {**asdict(first), "design": made.design.model_dump(mode="json")}

        tell_program("draft", draft)
    done = write_proposal(made, part, wishes, choose, out, teller)
    words = proposal_in_words(done.made, done.left_out)
    if not json:
        show([text(proposal_lines(words, verbose))])
    print_remarks(f"note: {one_line(note)}" for note in done.made.mesh.notes)
    untold = (one for one in done.made.warnings if not is_to_be_settled(one, done.made))
    print_remarks(f"warning: {one.text}" for one in untold)
    if json:
        studies = [str(out / name) for name in done.studies]
        settings = {"settings": [str(out / name) for name in done.settings]}
        settings = settings if done.settings else {}
        print_json({**asdict(words), "design": str(out / DESIGN), "studies": studies, **settings})
        return
    designs = [f"design in {out / name}" for name in (DESIGN, *done.settings)]
    studies = [f"study in {out / name}" for name in done.studies]
    show([*designs, *studies, f"next: chamberopt simulate {quote(str(out / DESIGN))}"])


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
    from chamberopt.documents.proposal import choice_lines, choices_of

    show(choice_lines(choices_of(known), len(known)))
    try:
        answer = input("to be peened, separated by commas: ").strip()
    except EOFError:
        raise InputError("--target: pick got no answer; answer, or give names or faces") from None
    if any(one.name == answer for one in known):  # a single name with commas
        return [answer]
    return [name.strip() for name in answer.split(",") if name.strip()]
