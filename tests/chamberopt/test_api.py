"""From Python: the names are there, and what is no design, study or result is named."""

from pathlib import Path

import pytest

import chamberopt
from chamberopt.common.errors import InputError


def test_the_names_are_listed() -> None:
    assert set(chamberopt.__all__) <= set(dir(chamberopt))


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("design", lambda folder: chamberopt.simulate("designs/gear.toml", folder)),  # type: ignore[arg-type]
        ("study", lambda folder: chamberopt.optimise({"vary": {}}, folder)),  # type: ignore[arg-type]
        ("result", lambda folder: chamberopt.show(folder)),  # type: ignore[arg-type]
    ],
)
def test_what_is_none_is_named_with_its_maker(name, call, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=rf"^{name}: given .*chamberopt\.(load_{name}|simulate)"):
        call(tmp_path / "out")
    assert not (tmp_path / "out").exists()
