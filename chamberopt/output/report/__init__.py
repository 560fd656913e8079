"""A result as one HTML page that needs nothing but a browser."""

from chamberopt.output.report.contents import report_contents
from chamberopt.output.report.page import write_part_page, write_report

__all__ = ["report_contents", "write_part_page", "write_report"]
