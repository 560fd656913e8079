"""Choose of what balls and walls are, by the metal of the part and its hardness."""

from __future__ import annotations

from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.shop import HARD, STEEL, Shop
from chamberopt.common.errors import InputError
from chamberopt.design.materials import alloy, alloys, ball, balls, find

CERAMIC = "zirconia"  # for metals on which steel leaves iron
# Walls: hardened steel, as soft ones slow the balls. Where they must leave no iron they are of the
# sonotrode's metal, and for stainless parts of a stainless steel that is as hard.
HARD_WALL, CLEAN_WALL, STAINLESS_WALL = "100Cr6", "Ti-6Al-4V", "17-4PH"
# Least hardness of steel balls over the part's. A part as hard as they are is dented less: in
# pilots of a gear of 650 HB tungsten carbide left 9 times the dents.
HARDER = 1.25
HARDENED_HB = 280.0  # of steel: from here on it was hardened, to what its name does not tell
# By metal of the part. Of aluminium: SAE AMS-S-13165, note 5 to table VI (design/intensity.py).
IRON = {
    "aluminium": f"{MatterKind.IRON} on aluminium: decontaminate (note 5 to table VI of SAE "
    "AMS-S-13165), or ceramic balls, such as --shot zirconia",
    "titanium": f"{MatterKind.IRON} on titanium: decontaminate, or ceramic balls, such as --shot "
    "zirconia (no source read)",
    "cobalt": f"{MatterKind.IRON} on cobalt, as of implants: decontaminate, or ceramic balls, "
    "such as --shot zirconia (no source read)",
}
ON_STAINLESS = (
    f"{MatterKind.IRON} on stainless steel, which rusts: passivate the part, or ceramic balls, "
    "such as --shot zirconia (no source read)"
)


def choose_shot(name: str, part: str, shop: Shop) -> tuple[str, str]:
    """Return the material of the balls, and why they are not of steel or what steel leaves behind.

    Raises InputError if a wanted material is unknown, or its hardness and so its restitution is
    not known.

    Args:
        name: the wanted material; if it is empty, steel, a harder one for a hard part, or a
            ceramic where steel must leave no iron.
        part: the part's alloy.
    """
    if name and ball(name).hardness_HB is None:
        known = ", ".join(one.name for one in balls() if one.hardness_HB is not None)
        text = "the hardness of these balls is not known, and their restitution follows from it"
        raise InputError(f"--shot: given {name!r}; {text}; give one of {known}")
    hardness = alloy(part).hardness_HB
    metal, is_stainless = alloy(part).metal, alloy(part).stainless
    spoiled = metal if metal in IRON else "stainless steel" if is_stainless else ""
    if not name and spoiled and shop.has(CERAMIC):
        return CERAMIC, f"steel leaves iron on {spoiled}"
    if name or (ball(STEEL).hardness_HB or 0.0) >= HARDER * hardness or not shop.has(HARD):
        found = ball(name or STEEL).name
        on_steel = ON_STAINLESS if is_stainless else ""
        return found, IRON.get(metal, on_steel) if found == STEEL else ""
    return HARD, f"harder than the part, of {hardness:g} HB: balls of steel dent it less"


def choose_walls(part: str, shot: str) -> tuple[str, str]:
    """Return the metal of the walls, and the reason for it.

    Args:
        part: the part's alloy.
        shot: material of the balls. Those of steel leave iron whatever the walls are of.
    """
    if shot == STEEL or not iron_of_walls(part, HARD_WALL):
        return HARD_WALL, "hardened, as soft walls slow the balls; give yours"
    own = alloy(part)
    walls = STAINLESS_WALL if own.stainless else CLEAN_WALL
    metal = "stainless steel" if own.stainless else own.metal
    return walls, (
        f"leaves no iron on {metal}, as {HARD_WALL} would; at {alloy(walls).hardness_HB:g} HB it "
        f"slows the balls more than {HARD_WALL} of {alloy(HARD_WALL).hardness_HB:g} HB, which is "
        "simulated; give yours"
    )


def iron_of_walls(part: str, walls: str) -> str:
    """Return what walls that may leave iron on a part's metal need; "" where they leave none.

    Balls carry off what they wear from the walls, and press it into the part.

    Args:
        part, walls: their alloys; empty or of no catalogue where they are not known.
    """
    own, of_walls = find(part, alloys()), find(walls, alloys())
    if own is None or of_walls is None or of_walls.metal != "steel":
        return ""
    is_spoiled = own.metal in IRON or (own.stainless and not of_walls.stainless)
    if not is_spoiled:
        return ""
    name = "stainless steel" if own.stainless else own.metal
    hard = "stainless steel" if own.stainless else "titanium or aluminium"
    return (
        f"{MatterKind.IRON_FROM_WALLS}: balls carry what they wear from {of_walls.name} onto "
        f"{name}, whatever they are made of: walls of {hard} (materials.wall), or lined with it, "
        "which slow the balls more where they are softer (simulate again), or decontaminate the "
        "part after peening (no source read)"
    )


def hardness_in_words(part: str, shot: str) -> str:
    """Return what is said of a hardness that decides the balls or the intensity; else nothing.

    The name of a steel that is hardened does not tell in which state the part is.

    Args:
        part: the part's alloy.
        shot: material of the balls.
    """
    metal = alloy(part)
    if metal.metal != "steel" or metal.stainless or metal.hardness_HB < HARDENED_HB:
        return ""
    state = metal.condition.replace(";", ",").replace(f", {metal.hardness_HB:g} HB", "")
    text = f"; {MatterKind.HARDNESS}, {metal.hardness_HB:g} HB ({state}): confirm it, as "
    if shot == HARD:
        return (
            f"{text}it decides the balls: of steel, {ball(STEEL).hardness_HB:g} HB, they are "
            "hardly harder than the part and dent it less, but wear the sonotrode less (--shot "
            "steel)"
        )
    return f"{text}it decides which intensity is usual"
