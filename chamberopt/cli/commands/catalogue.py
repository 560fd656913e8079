"""The commands `materials`, `shot` and `shop`: alloys, balls as they are sold, what a shop has.

`materials` lists friction and slopes of faces too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

from chamberopt.cli.console import print_json, show
from chamberopt.cli.options import Json, app
from chamberopt.documents.document import Table

if TYPE_CHECKING:
    from chamberopt.design.materials.catalogue import Alloy, Ball

UNITS = {"density_kg_m3": "kg/m³", "E_GPa": "E GPa", "poisson": "nu", "hardness_HB": "HB",
         "yield_MPa": "yield MPa", "tensile_MPa": "tensile MPa"}  # fmt: skip


@app.command
def materials(name: str | None = None, /, *, json: Json = False) -> None:
    """List the alloys that [materials] of a design may name, and restitution and friction on each.

    Parameters
    ----------
    name
        One alloy, by any of its names; all of them if it is left out.
    """
    from chamberopt.design.materials import (
        DEFAULT_C0,
        alloy,
        alloys,
        balls,
        computed_v0,
        friction_pairs,
        treatments,
    )

    listed = alloys() if name is None else (alloy(name),)
    hard = [ball for ball in balls() if ball.hardness_HB is not None]
    speeds = {one.name: {ball.name: computed_v0(ball, one) for ball in hard} for one in listed}
    if json:
        rows = [one.model_dump() | {"C0": DEFAULT_C0, "v0_m_s": speeds[one.name]} for one in listed]
        pairs = [one.model_dump() for one in friction_pairs()]
        slopes = [one.model_dump() for one in treatments()]
        print_json({"alloys": rows, "friction": pairs, "treatments": slopes})
        return
    head = ["", *UNITS.values(), *(f"v0 {ball.also[0]}" for ball in hard), "HB, MPa read in"]
    lines = []
    for one in listed:
        numbers = [getattr(one, key) for key in UNITS]
        speed = speeds[one.name].values()
        lines.append([one.name, *map(_text, (*numbers, *speed)), one.kind])
    show([
        Table("", head, lines),
        "",
        f"v0 [m/s] of these balls: e = C0 for v < v0, C0 (v / v0)^(-1/4) above, C0 = {DEFAULT_C0};",
        "by Johnson's formula from E, HB and the ball's density: to calibrate "
        "(docs/reference/physics.md)",
        "",
        *_friction({one.metal for one in listed}),
        *_sources(listed),
    ])  # fmt: skip


@app.command
def shop(file: Path | None = None, /, *, example: bool = False) -> None:
    """Check a file of what a shop has (sonotrodes, balls, chambers), or print one as an example.

    Parameters
    ----------
    file
        The shop's file, which `chamberopt new PART --shop FILE` takes.
    example
        Print an annotated file with usual sizes, to start from.
    """
    from chamberopt.chamber.shop import example_text, load_shop
    from chamberopt.common.errors import InputError

    if example == (file is not None):
        raise InputError("shop: give the shop's file, or --example: one of them")
    if file is None:
        show([example_text().rstrip("\n")])
        return
    found = load_shop(file)
    show([f"{one.face.in_words}, {one.frequency_khz:g} kHz" for one in found.sonotrodes])
    stock = [
        f"{one.material}: {', '.join(f'{d:g}' for d in one.diameters_mm)} mm" for one in found.balls
    ]
    show(["balls:", *(stock or ["all that are sold (chamberopt shot)"])])


@app.command
def shot(name: str | None = None, /, *, json: Json = False) -> None:
    """List the balls that shot.material may name, the sizes in which they are sold, and grades.

    Parameters
    ----------
    name
        One material of balls, by any of its names; all of them if it is left out.
    """
    from chamberopt.design.materials import ball, balls, computed_v0, grades

    listed = balls() if name is None else (ball(name),)
    speeds = {
        one.name: None if one.hardness_HB is None else computed_v0(one, one) for one in listed
    }
    if json:
        rows = [one.model_dump() | {"v0_m_s": speeds[one.name]} for one in listed]
        print_json({"balls": rows, "grades": [one.model_dump() for one in grades()]})
        return
    keys = list(UNITS)[:4]
    head, table = ["", *(UNITS[key] for key in keys), "v0 m/s", "grades", "read in"], []
    for one in listed:
        numbers = (*(getattr(one, key) for key in keys), speeds[one.name])
        table.append([one.name, *map(_text, numbers), " ".join(one.grades), one.kind])
    lines = ["", "v0: of two such balls. Diameters [mm] in which they are sold:"]
    for one in listed:
        lines += _wrapped(f"{one.name}: {', '.join(map(_text, one.sizes_mm))}")
    limits = [[one.name, *map(_text, (one.ball_um, one.form_um, one.lot_um))] for one in grades()]
    tolerances = Table("", ("ISO 3290-1, µm", "one ball", "form", "lot"), limits)
    show([Table("", head, table), *lines, "", tolerances, "", *_sources(listed)])


def _friction(metals: Iterable[str]) -> Iterator[Table | str]:
    """Yield tables of the friction of balls on these metals, and of the slopes of faces."""
    from chamberopt.design.materials import friction_pairs, treatments

    metals = {*metals, "any", "balls"}
    shown = [one for one in friction_pairs() if one.metal in metals]
    lines = [
        [
            f"{one.ball} on {one.metal}",
            f"{one.mu:g}",
            " to ".join(map(_text, one.mu_range)),
            f"{one.beta0:g}",
            one.sure,
        ]
        for one in shown
    ]
    yield Table("", ("friction, dry", "mu", "mu may be", "beta0", "how sure"), lines)
    yield from ("", 'effects.friction = "catalogue" takes these, "any" where no other fits.', "")
    slopes = [
        [one.name, f"{one.slope_deg:g}", " to ".join(map(_text, one.slope_range))]
        for one in treatments()
    ]
    yield Table("", ("effects.roughness", "rms slope, degrees", "may be"), slopes)
    yield ""
    for name, source in sorted({(one.ball + " on " + one.metal, one.source) for one in shown}):
        yield name
        yield from _wrapped(source)
    for one in treatments():
        yield one.name
        yield from _wrapped(one.source)


def _sources(listed: Sequence[Alloy | Ball]) -> list[str]:
    """Return the source of each row, after the counts of rows by the kind of their source."""
    counts = Counter(one.origin for one in listed).most_common()
    text = "; ".join(f"{count} {origin}" for origin, count in counts)
    lines = _wrapped(f"{len(listed)} rows: {text}", "") if len(listed) > 1 else []
    for one in listed:
        lines.append(f"{one.name} ({', '.join(one.also)}): {one.condition}, {one.origin}")
        lines += _wrapped(one.source)
    return lines


def _wrapped(text: str, indent: str = "    ") -> list[str]:
    return wrap(  # an address stays in one piece
        text,
        100,
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _text(number: float | None) -> str:
    return "-" if number is None else f"{number:g}"
