"""Each sentence is a line, and the columns of a table are aligned."""

from chamberopt.documents.document import Table
from chamberopt.printers import terminal


def test_tables_are_aligned() -> None:
    head, rows = ("", "n", "s"), [("one", "1", "x"), ("eleven", "11", "")]
    content = ["first", Table("", head, rows), Table("", ["alone"], rows, numbers=False)]
    assert terminal.text(content).splitlines() == [
        "first",
        "         n  s",
        "one      1  x",
        "eleven  11",
        "alone",
        "one     1   x",
        "eleven  11",
    ]
