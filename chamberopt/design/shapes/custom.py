"""Load and check a user's own shape: a Python file with one subclass of ChamberTable."""

import inspect
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from pydantic import ConfigDict, ValidationError, model_validator

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_TEXT_BYTES, read_limited
from chamberopt.design.shape_surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.design.shapes.base import ChamberTable
from chamberopt.design.table_base import STRICT
from chamberopt.geometry.meshes.self_intersection import refuse_self_intersection
from chamberopt.geometry.meshes.surface_error import SurfaceError, format_point
from chamberopt.geometry.triangles import area_vectors, find_shells

# Checks of a shape's surface before a part is taken out of it.

MAX_WIDTH = 10.0  # m: shipped shapes are smaller; a chamber with mm taken for m is larger


def find_fault(cavity: object) -> str | None:
    """Return what is wrong with the surface that a user's own shape made; None if nothing is.

    The text continues a sentence, such as "is not closed".
    """
    if not isinstance(cavity, ShapeSurface):
        given = type(cavity).__name__
        return f"gives {given}; it must give a chamberopt.design.shapes.ShapeSurface"
    try:
        vertices = np.asarray(cavity.vertices, dtype=np.float64)
        triangles, tags = np.asarray(cavity.triangles), np.asarray(cavity.tags)
    except (TypeError, ValueError):
        return "has vertices, triangles or tags that are not arrays of numbers"
    if any(array.ndim != 2 or array.shape[1] != 3 for array in (vertices, triangles)):
        shapes = f"vertices {vertices.shape} and triangles {triangles.shape}"
        return f"has {shapes}; their shapes must be (n, 3) and (m, 3)"
    if triangles.dtype.kind not in "iu" or len(triangles) < 4:
        return "has triangles that are not at least four rows of vertex numbers"
    if triangles.min() < 0 or triangles.max() >= len(vertices) or not np.isfinite(vertices).all():
        return "has triangles whose vertices do not exist or are not finite numbers"
    if tags.shape != triangles.shape[:1] or not np.isin(tags, (TAG_SONOTRODE, TAG_WALL)).all():
        return "must tag each triangle as TAG_SONOTRODE or TAG_WALL"
    width = float(np.ptp(vertices, axis=0).max())
    if width > MAX_WIDTH:
        limit = f"at most {MAX_WIDTH:g} m is allowed"
        return f"is {width:.4g} m wide; {limit}; its vertices are in metres, not mm"
    fault = _closure_fault(vertices, triangles) or _floor_fault(vertices, triangles, tags)
    return fault or _crossing_fault(vertices, triangles)


def with_array_types(cavity: ShapeSurface) -> ShapeSurface:
    """Return a sound surface with its arrays converted to the types of a ShapeSurface."""
    arrays = (cavity.vertices, np.float64), (cavity.triangles, np.int32), (cavity.tags, np.uint8)
    return ShapeSurface(*(np.asarray(array, dtype=kind) for array, kind in arrays))


def _closure_fault(vertices: np.ndarray, triangles: np.ndarray) -> str | None:
    count = len(vertices)
    a, b = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T.astype(np.int64)
    there, back = np.sort(a * count + b), np.sort(b * count + a)
    if (there[1:] == there[:-1]).any() or not np.array_equal(there, back):
        lone = np.setdiff1d(there, back)
        near = np.round(1e3 * vertices[lone[0] // count], 3).tolist() if lone.size else None
        place = "" if near is None else f", near {near} mm"
        rule = "each side of a triangle must meet one other, run the other way"
        return f"is not closed: {rule}{place}"
    _, volumes = find_shells(vertices, triangles)
    if len(volumes) > 1:
        return f"is in {len(volumes)} pieces; it must be one closed surface"
    return "is inside out: normals must point out of the cavity" if volumes[0] <= 0.0 else None


def _floor_fault(vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray) -> str | None:
    floor = triangles[tags == TAG_SONOTRODE]
    if not len(floor):
        return "has no triangle tagged TAG_SONOTRODE"
    if vertices[floor][..., 2].any() or (area_vectors(vertices, floor)[:, 2] > 0.0).any():
        return "has a sonotrode that is not the floor at z = 0, facing down"
    low = vertices[triangles][..., 2].min()
    return f"goes below the sonotrode, to z = {1e3 * low:.4g} mm" if low < 0.0 else None


def _crossing_fault(vertices: np.ndarray, triangles: np.ndarray) -> str | None:
    try:
        refuse_self_intersection(Path(), vertices, triangles)
    except SurfaceError as error:
        return f"crosses itself, near {format_point(error.edges.reshape(-1, 3).mean(axis=0))}"
    return None


class RecordedShape(ChamberTable):
    """Stand-in for a user's own shape in the design of a result: its values, without its code."""

    model_config = ConfigDict(**{**STRICT, "extra": "allow"})

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Raise InputError, because loading a result never runs the Python file of its shape."""
        raise InputError(
            f"chamber.shape: {self.shape}: named by a result, whose code is never run; load the "
            "design file to build its chamber again"
        )


def _is_positive(number: object) -> bool:
    # bool(...) is False for NaN
    return isinstance(number, int | float | np.number) and bool(number > 0.0)


# The optional methods of a shape: a description of each result, and a check of it.
OPTIONAL_METHODS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "widths_mm": (
        "widths [mm] by key",
        lambda given: isinstance(given, Mapping) and all(map(_is_positive, given.values())),
    ),
    "room": ("a volume [m³] above 0", _is_positive),
    "notes": (
        "a list of texts",
        lambda given: isinstance(given, list) and all(isinstance(one, str) for one in given),
    ),
}


def load_custom_shape(path: Path) -> type[ChamberTable]:
    """Return the class of the shape in a Python file: the same class while its content is the same.

    Raises InputError if the file cannot be read or run, or does not hold exactly one shape.
    """
    try:
        source = read_limited(path, MAX_TEXT_BYTES, "shape file (.py)", follow=True)
    except FileNotFoundError:
        message = toml_errors.explain_missing_file(path, "shape file", "*.py")
        raise InputError(message) from None
    return _run(path, source)


@lru_cache(maxsize=64)
def _run(path: Path, source: bytes) -> type[ChamberTable]:
    digest = sha256(source).hexdigest()
    module = ModuleType(f"chamberopt_own_shape_{digest[:16]}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # pydantic looks up the names in annotations here
    with _errors_of_the_file(path, "cannot be run"):
        exec(compile(source, str(path), "exec"), vars(module))
    classes = [value for value in vars(module).values() if isinstance(value, type)]
    tables = [cls for cls in classes if issubclass(cls, ChamberTable)]
    bases = {base for cls in tables for base in cls.__bases__}
    shapes = [cls for cls in tables if cls.__module__ == module.__name__ and cls not in bases]
    names = " and ".join(cls.__name__ for cls in shapes) or "none"
    if len(shapes) != 1:
        wanted = "one subclass of chamberopt.design.shapes.ChamberTable"
        raise InputError(f"{path}: must define {wanted}; it defines {names}")
    if inspect.isabstract(shapes[0]):
        lacking = ", ".join(sorted(shapes[0].__abstractmethods__))
        text = f"{names} does not define {lacking}(); see docs/how_to/chambers.md"
        raise InputError(f"{path}: {text}")
    return _with_checks(path, shapes[0], digest)


def _with_checks(path: Path, shape: type[ChamberTable], digest: str) -> type[ChamberTable]:
    """Return a subclass of a user's shape that reports faults of its code and surface as
    InputError.

    Args:
        path: the Python file of the shape.
        digest: SHA-256 of the file.
    """

    def check(name: str) -> Callable[..., Any]:
        def method(self: ChamberTable, *arguments: Any) -> object:
            with _errors_of_the_file(path, f"{name}() failed"):
                given = getattr(shape, name)(self, *arguments)
            wanted, is_right = OPTIONAL_METHODS.get(name, ("", lambda _: True))
            if not is_right(given):
                where = f"{path}: {name}() of {shape.__name__}"
                raise InputError(f"{where} gives {given!r}; it must give {wanted}")
            return given

        method.__doc__ = getattr(shape, name).__doc__
        return method

    unchecked_surface = check("surface")

    def surface(self: ChamberTable, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Return the surface that the user's file makes. Raises InputError if it has a fault."""
        # views of the part, which the shape cannot change
        views = vertices.view(), triangles.view()
        for view in views:
            view.flags.writeable = False
        cavity = unchecked_surface(self, *views)
        fault = find_fault(cavity)
        if fault:
            raise InputError(f"chamber.shape: {path}: surface() of {shape.__name__} {fault}")
        return with_array_types(cavity)

    def run_validators(
        cls: type[ChamberTable], values: object, validate: Callable[[object], object]
    ) -> object:
        """Run the checks of values in the user's shape. If their code fails, raise InputError."""
        with _errors_of_the_file(path, "its checks failed"):
            return validate(values)

    methods: dict[str, Any] = {name: check(name) for name in OPTIONAL_METHODS}
    methods["surface"] = surface
    methods["_run_validators"] = model_validator(mode="wrap")(classmethod(run_validators))  # type: ignore[arg-type]
    about = {"__module__": shape.__module__, "__doc__": shape.__doc__, "sha256": digest}
    metaclass: Any = type(shape)
    checked: type[ChamberTable] = metaclass(shape.__name__, (shape,), {**methods, **about})
    return checked


@contextmanager
def _errors_of_the_file(path: Path, what: str) -> Iterator[None]:
    """Turn an error in the user's code into InputError with the line of its origin.

    Args:
        path: the file with the code.
        what: what failed, for the message.
    """
    try:
        yield
    except (InputError, ValidationError):
        raise
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(path)]
        if isinstance(error, SyntaxError):
            line, text = error.lineno, error.msg
        else:
            line, text = (lines or [None])[-1], " ".join(str(error).split())
        place = f"{path}:{line}" if line else str(path)
        message = f"{place}: {what}: {type(error).__name__}: {text}"
        if isinstance(error, ModuleNotFoundError) and "chamberopt" in text:
            message += "; import what a shape needs from chamberopt.design.shapes"
        raise InputError(message) from None
