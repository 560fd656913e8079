"""Mark of tests that draw."""

import pytest

from chamberopt.pictures.subprocess_drawing import missing_opengl

needs_opengl = pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")
