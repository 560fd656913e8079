"""The part in its chamber, in three dimensions. The only room that imports pyvista."""

from chamberopt.viewer.apart import why_no_pictures
from chamberopt.viewer.difference import difference_picture, write_differences
from chamberopt.viewer.look import Look, cut_across, eye_at
from chamberopt.viewer.seen import Subject
from chamberopt.viewer.side_by_side import coverage_picture
from chamberopt.viewer.surfaces import CHAMBER, COVERAGE, read_surface, write_chamber, write_coverage
from chamberopt.viewer.two_sides import part_picture
from chamberopt.viewer.window import inspect

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
