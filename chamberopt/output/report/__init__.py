"""A result as one page for a browser, with all it needs inside. The only room that imports plotly."""

from chamberopt.output.report.facts import facts
from chamberopt.output.report.page import write_part_page, write_report

__all__ = ["facts", "write_part_page", "write_report"]
