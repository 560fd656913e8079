"""Text that is safe to show: on a terminal, and in a spreadsheet."""

import csv
import io

import pytest

from chamberopt.common.errors import spreadsheet_cell
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
