"""Base class of every table of a design or study file, and descriptors of values in SI units."""

from collections.abc import Iterable
from typing import ClassVar, Self

from pydantic import BaseModel, ConfigDict, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import metres


class SI:
    """Attribute of a table that gives a key's value in SI units: the value times a factor."""

    def __init__(self, key: str, factor: float, meaning: str) -> None:
        self._key, self._factor, self.__doc__ = key, factor, meaning

    def __get__(self, table: object, owner: object = None) -> float:
        return self if table is None else getattr(table, self._key) * self._factor  # type: ignore[return-value]


class Metres:
    """Attribute of a table that gives a position or three sides in metres, from a key in mm."""

    def __init__(self, key: str, meaning: str) -> None:
        self._key, self.__doc__ = key, meaning

    def __get__(self, table: object, owner: object = None) -> tuple[float, float, float]:
        return self if table is None else metres(getattr(table, self._key))  # type: ignore[return-value]


STRICT = ConfigDict(
    frozen=True, extra="forbid", strict=True, allow_inf_nan=False, ignored_types=(SI, Metres)
)

MAX_NAMES = 500  # numbers or metrics in one table: no design has as many


class FileTable(BaseModel):
    """Base class of the tables of design and study files.

    A table cannot be changed and refuses unknown keys. Its values are also checked against each
    other.
    """

    model_config = STRICT
    RENAMED: ClassVar[dict[str, str]] = {}  # new name of each renamed key, for errors
    REMOVED: ClassVar[dict[str, str]] = {}  # removed keys, and the reason for each removal

    def _problems(self) -> Iterable[Problem]:
        """Return the problems of values that are each in range but contradict each other."""
        return ()

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = list(self._problems())
        if problems:
            raise CrossCheckError(problems)
        return self
