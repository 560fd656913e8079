"""The part in its chamber, in three dimensions. The only room that imports pyvista."""

from chamberopt.output.viewer.images.coverage import coverage_picture
from chamberopt.output.viewer.images.difference import difference_picture, write_differences
from chamberopt.output.viewer.images.part import part_picture
from chamberopt.output.viewer.opened_result import Subject
from chamberopt.output.viewer.subprocess_drawing import why_no_pictures
from chamberopt.output.viewer.view_state import Look, cut_across, eye_at
from chamberopt.output.viewer.window import inspect
from chamberopt.output.vtp_files import (
    CHAMBER,
    COVERAGE,
    read_surface,
    write_chamber,
    write_coverage,
)

__all__ = [
    "CHAMBER",
    "COVERAGE",
    "Look",
    "Subject",
    "coverage_picture",
    "cut_across",
    "difference_picture",
    "eye_at",
    "inspect",
    "part_picture",
    "read_surface",
    "why_no_pictures",
    "write_chamber",
    "write_coverage",
    "write_differences",
]
