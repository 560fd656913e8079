"""Records that compiled functions hand on as one value.

numba hands each number of a record on as an argument of its own. The state of the event loop has
hundreds: each call took them out of the record and put them back, which was 90 % of the code that
the loop's compiler worked on.
"""

import hashlib
from collections.abc import Iterable
from typing import TypeVar

from numba import types
from numba.extending import models, register_model, typeof_impl

R = TypeVar("R", bound=Iterable[object])


class WholeRecord(types.NamedTuple):
    """Type of a NamedTuple that is handed on as one value."""

    @property
    def mangling_args(self) -> tuple[str, tuple[()]]:
        """A short name, since the name of each function of the machine code contains it."""
        digest = hashlib.sha256(self.name.encode()).hexdigest()[:16]
        return f"{self.instance_class.__name__}_{digest}", ()


@register_model(WholeRecord)
class _WholeRecordModel(models.TupleModel):
    def get_argument_type(self) -> object:
        return self.get_value_type()

    def as_argument(self, builder: object, value: object) -> object:
        return value

    def from_argument(self, builder: object, value: object) -> object:
        return value


def passed_whole(record: type[R]) -> type[R]:
    """Let compiled functions hand on a NamedTuple as one value.

    Only Python makes such records: in compiled code they would have numba's own type.
    """

    @typeof_impl.register(record)
    def _type_of(value: R, context: object) -> WholeRecord:
        return WholeRecord([typeof_impl(one, context) for one in value], record)

    return record
