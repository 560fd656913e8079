"""A user's own shape: a Python file with one subclass of ChamberTable, named by the design."""

import inspect
import sys
import traceback
from collections.abc import Callable, Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from pydantic import ConfigDict, ValidationError, model_validator

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.design.materials import STRICT
from chamberopt.design.shapes.base import ChamberTable
from chamberopt.design.shapes.closed_check import fault, in_arrays
from chamberopt.design.shapes.construction.surface import ShapeSurface


class KeptShape(ChamberTable):
    """Stands for a shape whose file is gone or broken, so that results made with it can still be looked at."""

    model_config = ConfigDict(**{**STRICT, "extra": "allow"})

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """By the file, should it be back; else InputError that says what is wrong with it."""
        return (
            custom_shape(Path(self.shape))
            .model_validate(self.model_dump())
            .surface(vertices, triangles)
        )


# What the methods that a shape may define give, and whether something is that.
GIVES: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "widths_mm": (
        "widths [mm] by key are",
        lambda found: isinstance(found, Mapping) and all(map(_above_0, found.values())),
    ),
    "room": ("a volume [m³] above 0 is", lambda found: _above_0(found)),
    "notes": (
        "a list of texts is",
        lambda found: isinstance(found, list) and all(isinstance(one, str) for one in found),
    ),
}


def custom_shape(path: Path) -> type[ChamberTable]:
    """The shape in a file; the same class as long as the file's content is the same. InputError if it holds none."""
    try:
        source = path.read_bytes()
    except FileNotFoundError:
        raise InputError(toml_errors.explain_missing_file(path, "shape file", "*.py")) from None
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror}; check its permissions"
        ) from None
    return _shape_in(path, source)


@lru_cache(maxsize=64)
def _shape_in(path: Path, source: bytes) -> type[ChamberTable]:
    digest = sha256(source).hexdigest()
    module = ModuleType(f"chamberopt_own_shape_{digest[:16]}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where pydantic looks up the names in annotations
    try:
        exec(compile(source, str(path), "exec"), vars(module))
    except (Exception, SystemExit) as error:
        raise InputError(_said(path, "cannot be run", error)) from None
    made = [
        cls
        for cls in vars(module).values()
        if isinstance(cls, type) and issubclass(cls, ChamberTable)
    ]
    bases = {base for cls in made for base in cls.__bases__}
    shapes = [cls for cls in made if cls.__module__ == module.__name__ and cls not in bases]
    names = " and ".join(cls.__name__ for cls in shapes) or "none"
    if len(shapes) != 1:
        raise InputError(
            f"{path}: one subclass of chamberopt.design.shapes.ChamberTable is wanted, it defines {names}"
        )
    if inspect.isabstract(shapes[0]):
        lacking = ", ".join(sorted(shapes[0].__abstractmethods__))
        raise InputError(f"{path}: {names} does not define {lacking}(); see docs/chambers.md")
    return _guarded(path, shapes[0], digest)


def _guarded(path: Path, shape: type[ChamberTable], digest: str) -> type[ChamberTable]:
    """The shape, its code's faults and those of its surface told as a user's."""

    def guard(name: str) -> Callable[..., Any]:
        def method(self: ChamberTable, *given: Any) -> Any:
            try:
                found = getattr(shape, name)(self, *given)
            except InputError:
                raise
            except (Exception, SystemExit) as error:
                raise InputError(_said(path, f"{name}() failed", error)) from None
            wanted, is_right = GIVES.get(name, ("", lambda _: True))
            if not is_right(found):
                raise InputError(
                    f"{path}: {name}() of {shape.__name__} gives {found!r}; {wanted} wanted"
                )
            return found

        method.__doc__ = getattr(shape, name).__doc__
        return method

    made = guard("surface")

    def surface(self: ChamberTable, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """As the file makes it, if it is a closed surface with a sonotrode."""
        cavity = made(self, _read_only(vertices), _read_only(triangles))
        wrong = fault(cavity)
        if wrong:
            raise InputError(f"chamber.shape: {path}: surface() of {shape.__name__} {wrong}")
        return in_arrays(cavity)

    def told(cls: type[ChamberTable], values: Any, rest: Callable[[Any], Any]) -> Any:
        """What its own validators trip over."""
        try:
            return rest(values)
        except (InputError, ValidationError):
            raise
        except (Exception, SystemExit) as error:
            raise InputError(_said(path, "its checks failed", error)) from None

    methods: dict[str, Any] = {name: guard(name) for name in GIVES} | {"surface": surface}
    methods["_told"] = model_validator(mode="wrap")(classmethod(told))  # type: ignore[arg-type]
    about = {"__module__": shape.__module__, "__doc__": shape.__doc__, "sha256": digest}
    metaclass: Any = type(shape)
    return metaclass(shape.__name__, (shape,), {**methods, **about})


def _above_0(number: object) -> bool:
    return isinstance(number, int | float | np.number) and bool(number > 0.0)  # not so of NaN


def _read_only(array: np.ndarray) -> np.ndarray:
    """The part is asked about, not changed."""
    view = array.view()
    view.flags.writeable = False
    return view


def _said(path: Path, what: str, error: BaseException) -> str:
    """Where in the user's file an error came from."""
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == str(path)
    ]
    line = error.lineno if isinstance(error, SyntaxError) else (lines or [None])[-1]
    place = f"{path}:{line}" if line else str(path)
    said = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
    return f"{place}: {what}: {type(error).__name__}: {said}"
