"""Pictures, films and a window of the part in its chamber, drawn with pyvista."""

from chamberopt.output.viewer.images.coverage import draw_coverage
from chamberopt.output.viewer.images.difference import draw_difference, write_differences
from chamberopt.output.viewer.images.part import draw_part
from chamberopt.output.viewer.opened_result import ResultInfo, result_info
from chamberopt.output.viewer.subprocess_drawing import missing_opengl, picture_path, require_opengl
from chamberopt.output.viewer.view_state import ViewState, parse_clip, parse_view
from chamberopt.output.viewer.window import inspect

__all__ = [
    "ResultInfo",
    "ViewState",
    "draw_coverage",
    "draw_difference",
    "draw_part",
    "inspect",
    "missing_opengl",
    "parse_clip",
    "parse_view",
    "picture_path",
    "require_opengl",
    "result_info",
    "write_differences",
]
