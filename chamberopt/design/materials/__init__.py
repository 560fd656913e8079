"""Materials of balls and surfaces: tables of a design, and a catalogue of metals by name."""

from chamberopt.design.materials.catalogue import (
    BRINELL_TO_PASCAL,
    Alloy,
    alloy,
    alloys,
    ball,
    ball_sizes,
    balls,
    find,
    grades,
)
from chamberopt.design.materials.friction import (
    BY_NAME,
    CATALOGUE,
    NONE,
    USUAL,
    friction_pairs,
    surface_pairs,
    treatment,
    treatments,
    with_friction,
)
from chamberopt.design.materials.named_metals import DEFAULT_C0, SURFACES, computed_v0, with_numbers
from chamberopt.design.materials.tables import Materials, PartMaterial, RestitutionTable

__all__ = [
    "BRINELL_TO_PASCAL",
    "BY_NAME",
    "CATALOGUE",
    "DEFAULT_C0",
    "NONE",
    "SURFACES",
    "USUAL",
    "Alloy",
    "Materials",
    "PartMaterial",
    "RestitutionTable",
    "alloy",
    "alloys",
    "ball",
    "ball_sizes",
    "balls",
    "computed_v0",
    "find",
    "friction_pairs",
    "grades",
    "surface_pairs",
    "treatment",
    "treatments",
    "with_friction",
    "with_numbers",
]
