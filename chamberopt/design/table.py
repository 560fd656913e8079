"""What every table of a design file has in common."""

from collections.abc import Iterable
from typing import ClassVar, Self

from pydantic import BaseModel, ConfigDict, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem

STRICT = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class DesignTable(BaseModel):
    """A frozen table without unknown keys, whose values are also checked against each other."""

    model_config = STRICT
    RENAMED: ClassVar[dict[str, str]] = {}  # former names of keys: an error names the new one

    def _problems(self) -> Iterable[Problem]:
        """Problems of values that are each in range but contradict each other."""
        return ()

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = list(self._problems())
        if problems:
            raise CrossCheckError(problems)
        return self
