"""Compose a process sheet of a result, of what is set, expected, measured first and warned of."""

from chamberopt.documents.sheet.document import (
    REQUALIFY,
    design_sha256,
    limit_tables,
    process_sheet,
    setting_tables,
    title_block,
)
from chamberopt.documents.sheet.expected import calibrated_to, first_checks
from chamberopt.documents.sheet.openings import (
    clearance_of,
    cut_of,
    drawn_openings,
    outlines_in_words,
)
from chamberopt.documents.sheet.rows import AsBuilt, amplitude_text, key_row
from chamberopt.documents.sheet.settings import chamber_limits, reference_limits, slit_limits
from chamberopt.documents.sheet.warned import alarms, cautions

__all__ = [
    "REQUALIFY",
    "AsBuilt",
    "alarms",
    "amplitude_text",
    "calibrated_to",
    "cautions",
    "chamber_limits",
    "clearance_of",
    "cut_of",
    "design_sha256",
    "drawn_openings",
    "first_checks",
    "key_row",
    "limit_tables",
    "outlines_in_words",
    "process_sheet",
    "reference_limits",
    "setting_tables",
    "slit_limits",
    "title_block",
]
