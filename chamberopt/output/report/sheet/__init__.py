"""The process sheet of a result: one printable page with what a shop sets, expects and measures."""

from chamberopt.output.report.sheet.page import write_sheet

__all__ = ["write_sheet"]
