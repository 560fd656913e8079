"""Records that compiled functions hand on by their address.

numba hands each number of a record on as an argument of its own. The state of the event loop has
hundreds: each call took them out of the record and put them back, which was 90 % of the code that
the loop's compiler worked on. Handed on as one value, the state of contact mode was copied for each
call, which made a collision in contact mode a fifth slower. Here a record lies where the call from
Python put it, and each number is read where the code names it.
"""

import hashlib
from collections.abc import Iterable
from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.pythonapi import NativeValue
from numba.extending import lower_getattr_generic, models, register_model, typeof_impl, unbox

R = TypeVar("R", bound=Iterable[object])


class RecordAddress(types.NamedTuple):
    """Type of a NamedTuple in compiled code, which has the address of its fields in place of it."""

    @property
    def mangling_args(self) -> tuple[str, tuple[()]]:
        """A short name, since the name of each function of the machine code contains it."""
        digest = hashlib.sha256(self.name.encode()).hexdigest()[:16]
        return f"{self.instance_class.__name__}_{digest}", ()


@register_model(RecordAddress)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: RecordAddress) -> None:
        fields = ir.LiteralStructType([manager.lookup(one).get_value_type() for one in kind])
        super().__init__(manager, kind, fields.as_pointer())


def _from_python(kind: RecordAddress, record: Any, c: Any) -> NativeValue:
    """Put the fields in memory that lives as long as the call from Python."""
    place = cgutils.alloca_once(c.builder, c.context.get_value_type(kind).pointee)
    is_error, cleanups = cgutils.false_bit, []
    for number, field in enumerate(kind):
        native = c.unbox(field, c.pyapi.tuple_getitem(record, number))
        c.builder.store(native.value, _field(c.builder, place, number))
        is_error = c.builder.or_(is_error, native.is_error)
        if native.cleanup is not None:
            cleanups.append(native.cleanup)

    def cleanup() -> None:
        for one in reversed(cleanups):
            one()

    return NativeValue(place, is_error=is_error, cleanup=cleanup)


def _get_field(context: Any, builder: Any, kind: RecordAddress, place: Any, name: str) -> Any:
    return _read(builder, _field(builder, place, kind.fields.index(name)))


# As decorators, which have no types, they would hide the types of both functions.
unbox(RecordAddress)(_from_python)
lower_getattr_generic(RecordAddress)(_get_field)


def _field(builder: Any, place: Any, number: int) -> Any:
    return cgutils.gep_inbounds(builder, place, 0, number)


def _read(builder: Any, place: Any) -> Any:
    """Read a value number by number, so that the compiler can leave out what nobody uses."""
    kind = place.type.pointee
    if not isinstance(kind, ir.Aggregate):
        return builder.load(place)
    value = ir.Constant(kind, ir.Undefined)
    for number in range(len(kind)):
        value = builder.insert_value(value, _read(builder, _field(builder, place, number)), number)
    return value


def passed_by_address(record: type[R]) -> type[R]:
    """Let compiled functions hand on a NamedTuple by its address.

    Only Python makes such records: in compiled code they would have numba's own type.
    """

    @typeof_impl.register(record)
    def _type_of(value: R, context: object) -> RecordAddress:
        return RecordAddress([typeof_impl(one, context) for one in value], record)

    return record
