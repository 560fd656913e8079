"""Text that is safe to show: on a terminal, and in a spreadsheet."""

import csv
import io
import re

import pytest
from pydantic import BaseModel, ValidationError, field_validator

from chamberopt.common.errors import first_wrong_value, one_line, spreadsheet_cell, visible
from chamberopt.common.files import csv_text


@pytest.mark.parametrize("text", ["=1+1", "+x", "-x", "@SUM(A1)", "\t=1", "\n=1", "=", "-1-1"])
def test_a_formula_becomes_a_text(text: str) -> None:
    assert spreadsheet_cell(text) == f"'{text}"


@pytest.mark.parametrize("value", [-1, -0.5, "-1", "+1e-3", "-inf", None, True, "", "a=1", "x-1"])
def test_numbers_and_plain_texts_stay(value: object) -> None:
    assert spreadsheet_cell(value) == value


def test_no_cell_of_a_table_is_a_formula() -> None:
    assert spreadsheet_cell("a\r=1") == "a\n=1"  # within quotes, unlike a carriage return
    rows = [{"name": "=HYPERLINK(1)", "value": -3.5}, {"=cmd|' /C calc'!A0": "@x\r=1"}]
    read = list(csv.reader(io.StringIO(csv_text(rows))))
    assert read == [["name", "value", "'=cmd|' /C calc'!A0"], ["'=HYPERLINK(1)", "-3.5", ""],
                    ["", "", "'@x\n=1"]]  # fmt: skip


def test_what_a_terminal_would_obey_is_written_out() -> None:
    assert visible("a\x1b[2J\tb\nc\x7f") == "a\\x1b[2J\tb\nc\\x7f"
    assert one_line("a\tb\nc\r") == "a\tb\\nc\\r"


def test_the_first_wrong_value_is_named_by_its_place() -> None:
    class Inner(BaseModel):
        sizes: list[float]

        @field_validator("sizes")
        @classmethod
        def _positive(cls, sizes: list[float]) -> list[float]:
            if min(sizes) < 0.0:
                raise ValueError("below 0")
            return sizes

    class Outer(BaseModel):
        inner: Inner
        name: str

    for given, said in (
        ({"inner": {"sizes": [1.0, "x"]}, "name": 3}, r"^inner\.sizes\.1: Input should be a valid"),
        ({"inner": {"sizes": [-1.0]}, "name": "a"}, r"^inner\.sizes: below 0$"),
        (7, "^Input should be a valid"),
    ):
        with pytest.raises(ValidationError) as caught:
            Outer.model_validate(given)
        assert re.search(said, first_wrong_value(caught.value))
