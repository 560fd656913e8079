"""Surfaces that must not be peened, by their names."""

import pytest

from chamberopt.chamber.propose.proposed_mask import NEVER


@pytest.mark.parametrize(
    "name",
    ["BORE", "bores", "BOLT_HOLES", "hole_3", "M6 thread", "BEARING_SEAT", "keyway", "spline"],
)
def test_what_fits_to_other_parts_is_masked(name: str) -> None:
    assert NEVER.search(name)


@pytest.mark.parametrize("name", ["BASE", "wholesale", "SHANK", "boretto", "TIP", "FILLETS"])
def test_other_names_are_not(name: str) -> None:
    assert not NEVER.search(name)
