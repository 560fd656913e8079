"""A result as one HTML page that needs nothing but a browser."""

from chamberopt.output.report.page import require_free_page, write_part_page, write_report
from chamberopt.output.report.report_data import report_contents

__all__ = ["report_contents", "require_free_page", "write_part_page", "write_report"]
