"""All hard cases, in the order of the table; a new file of cases is added here."""

from tests.hard_cases.cases import clusters, drops, extremes, meshes, narrow, refusals
from tests.hard_cases.outcome import Case

CASES: list[Case] = [
    *drops.CASES,
    *clusters.CASES,
    *narrow.CASES,
    *meshes.CASES,
    *extremes.CASES,
    *refusals.CASES,
]
