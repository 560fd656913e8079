"""Types of the fields of result.json: tables, and estimates as they are stored.

Fields that only a few records have are defined beside these records.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Self, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, WrapValidator, model_validator

from chamberopt.common.estimate import Estimate

Positive = Annotated[float, Field(ge=0.0)]


class Table(BaseModel):
    """The base of all tables of result.json. Unknown keys are allowed and ignored."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    def as_json(self) -> dict[str, object]:
        """Return the table as JSON values, without the keys that its writer did not set."""
        return self.model_dump(mode="json", exclude_unset=True)


class _IntervalValues(Table):
    """A value and its half-width. An unknown number is null, and `in_words` tells why."""

    value: float | None
    half_width: Positive | None
    in_words: str = ""

    def estimate(self) -> Estimate:
        return Estimate.from_interval_json(self.model_dump())


class _KnownValues(_IntervalValues):
    """An interval whose value must be known. Words may take the place of its half-width."""

    @model_validator(mode="after")
    def _is_known(self) -> Self:
        if self.value is None or (self.half_width is None and not self.in_words):
            raise ValueError("an estimate without a value or half_width")
        return self


class _EstimateValues(_KnownValues):
    pseudovalues: list[float]
    bias: float | None  # None if it is infinite, because there are no dents
    shared: list[float]

    def estimate(self) -> Estimate:
        return Estimate.from_json(self.model_dump())


def _estimate(value: object, read: Callable[[object], _IntervalValues]) -> Estimate:
    return value if isinstance(value, Estimate) else read(value).estimate()


if TYPE_CHECKING:
    Interval: TypeAlias = Estimate
    KnownInterval: TypeAlias = Estimate
    WholeEstimate: TypeAlias = Estimate
else:  # an estimate is stored with fewer or more of its numbers, as readers need them
    _READ, _AS_INTERVAL = WrapValidator(_estimate), PlainSerializer(Estimate.interval_json)
    Interval = Annotated[_IntervalValues, _READ, _AS_INTERVAL]
    KnownInterval = Annotated[_KnownValues, _READ, _AS_INTERVAL]
    WholeEstimate = Annotated[_EstimateValues, _READ, PlainSerializer(Estimate.to_json)]
