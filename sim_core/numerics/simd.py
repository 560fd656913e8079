"""Eight comparisons in one instruction: float32 filters in front of the exact float64 tests.

The filters leave out boxes that a flight does not enter, and balls that cannot meet a given ball.
They may let through too much but never too little, so that results do not depend on them, bit for
bit. Each filter has a numpy version that replaces it when numba's JIT is off.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.base import BaseContext
from numba.core.typing.context import BaseContext as TypingContext
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

BOXES = 8  # children of a tree node
WIDTH = 8  # numbers in one instruction; 16 ran a quarter slower, as the processor lowers its clock
LANES = 2 * WIDTH  # balls compared before one branch on the result

_F32 = ir.FloatType()
_I32 = ir.IntType(32)

# Writer of a function's machine code, and the function's signature with such a writer.
_Writer = Callable[[BaseContext, ir.IRBuilder, Signature, Sequence[ir.Value]], ir.Value]
_Function = tuple[Signature, _Writer]


class _Vectors:
    """Writer of machine code that works on ``width`` float32 numbers, the lanes, at once."""

    def __init__(self, builder: ir.IRBuilder, width: int) -> None:
        self.builder = builder
        self.width = width
        self.type = ir.VectorType(_F32, width)

    def spread(self, scalar: ir.Value) -> ir.Value:
        """Return a vector with the scalar in every lane."""
        one = self.builder.insert_element(ir.Constant(self.type, ir.Undefined), scalar, _I32(0))
        mask = ir.Constant(ir.VectorType(_I32, self.width), [0] * self.width)
        return self.builder.shuffle_vector(one, ir.Constant(self.type, ir.Undefined), mask)

    def load(self, data: ir.Value, index: ir.Value) -> ir.Value:
        """Return ``width`` consecutive numbers, read from data[index] on."""
        address = self.builder.bitcast(self.builder.gep(data, [index]), self.type.as_pointer())
        return self.builder.load(address, align=4)

    def store(self, vector: ir.Value, data: ir.Value, index: ir.Value) -> None:
        """Write ``width`` consecutive numbers to data[index] and after."""
        address = self.builder.bitcast(self.builder.gep(data, [index]), self.type.as_pointer())
        self.builder.store(vector, address, align=4)

    def smaller(self, a: ir.Value, b: ir.Value) -> ir.Value:
        return self.builder.select(self.builder.fcmp_ordered("<", a, b), a, b)

    def larger(self, a: ir.Value, b: ir.Value) -> ir.Value:
        return self.builder.select(self.builder.fcmp_ordered(">", a, b), a, b)

    def fused(self, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
        """Return ``a b + c``, rounded only once, which is allowed in a filter."""
        kind = ir.FunctionType(self.type, [self.type] * 3)
        function = cgutils.get_or_insert_function(
            self.builder.module, kind, f"llvm.fma.v{self.width}f32"
        )
        return self.builder.call(function, [a, b, c])

    def rounded(self, a: ir.Value) -> ir.Value:
        """Return the numbers ``a``, rounded to whole numbers."""
        kind = ir.FunctionType(self.type, [self.type])
        function = cgutils.get_or_insert_function(
            self.builder.module, kind, f"llvm.rint.v{self.width}f32"
        )
        return self.builder.call(function, [a])

    def sum(self, total: ir.Value | None, a: ir.Value, b: ir.Value) -> ir.Value:
        """Return ``total + a b``, or ``a b`` if the total is None."""
        return self.builder.fmul(a, b) if total is None else self.fused(a, b, total)

    def mask(self, condition: ir.Value) -> ir.Value:
        """Return a condition, true or false in each lane, as the bits of an int64."""
        bits = self.builder.bitcast(condition, ir.IntType(self.width))
        return self.builder.zext(bits, ir.IntType(64))


def _data_of(
    context: BaseContext, builder: ir.IRBuilder, array_type: types.Array, array: ir.Value
) -> ir.Value:
    return context.make_array(array_type)(context, builder, array).data


@intrinsic
def _boxes_hit(
    typing_context: TypingContext,
    bounds: types.Type,
    node: types.Type,
    ray: types.Type,
    longest: types.Type,
    enter: types.Type,
) -> _Function:
    signature = types.int64(bounds, types.int64, ray, types.float32, enter)

    def codegen(
        context: BaseContext, builder: ir.IRBuilder, _: Signature, arguments: Sequence[ir.Value]
    ) -> ir.Value:
        bounds_type, _, ray_type, _, enter_type = signature.args
        bounds, node, ray, longest, enter = arguments
        v = _Vectors(builder, BOXES)
        boxes = _data_of(context, builder, bounds_type, bounds)
        rays = _data_of(context, builder, ray_type, ray)
        first = builder.mul(node, ir.Constant(node.type, 6 * BOXES))
        near = v.spread(ir.Constant(_F32, 0.0))
        far = v.spread(longest)
        for axis in range(3):

            def number(k: int, axis: int = axis) -> ir.Value:
                return v.spread(
                    builder.load(builder.gep(rays, [ir.Constant(node.type, 3 * k + axis)]))
                )

            low = v.load(boxes, builder.add(first, ir.Constant(node.type, axis * BOXES)))
            high = v.load(boxes, builder.add(first, ir.Constant(node.type, (3 + axis) * BOXES)))
            inverse = number(2)
            one = builder.fmul(builder.fsub(low, number(0)), inverse)
            two = builder.fmul(builder.fsub(high, number(1)), inverse)
            near = v.larger(near, v.smaller(one, two))
            far = v.smaller(far, v.larger(one, two))
        v.store(near, _data_of(context, builder, enter_type, enter), ir.Constant(node.type, 0))
        return v.mask(builder.fcmp_ordered("<=", near, far))

    return signature, codegen


def _boxes_hit_numpy(
    bounds: np.ndarray, node: int, ray: np.ndarray, longest: np.float32, enter: np.ndarray
) -> int:
    box = bounds[node]
    with np.errstate(over="ignore", invalid="ignore"):
        one = (box[0:3] - ray[0:3, None]) * ray[6:9, None]
        two = (box[3:6] - ray[3:6, None]) * ray[6:9, None]
    near = np.maximum(np.float32(0.0), np.minimum(one, two).max(axis=0))
    far = np.minimum(longest, np.maximum(one, two).min(axis=0))
    enter[:] = near
    return int(np.packbits(near <= far, bitorder="little")[0])


def _near_filter(
    lanes: types.Type, probe: types.Type, limited: bool, periodic: bool = False
) -> _Function:
    """Return the signature and the code generator of a filter of pairs of balls that may meet.

    limited: True to leave out pairs that cannot meet before the end of the search.
    periodic: True to compare the nearest images of balls in a periodic box.
    """
    signature = types.int64(lanes, types.int64, probe)

    def codegen(
        context: BaseContext, builder: ir.IRBuilder, _: Signature, arguments: Sequence[ir.Value]
    ) -> ir.Value:
        lanes_type, _, probe_type = signature.args
        lanes, first, probe = arguments
        v = _Vectors(builder, WIDTH)
        columns = _data_of(context, builder, lanes_type, lanes)
        probes = _data_of(context, builder, probe_type, probe)
        shape = cgutils.unpack_tuple(
            builder, context.make_array(lanes_type)(context, builder, lanes).shape
        )
        width = shape[1]
        constant = width.type

        def number(k: int) -> ir.Value:
            return v.spread(builder.load(builder.gep(probes, [ir.Constant(constant, k)])))

        def near_of(start: ir.Value) -> ir.Value:
            square = closing = speed = None
            for axis in range(3):
                place, velocity = (
                    v.load(
                        columns, builder.add(builder.mul(width, ir.Constant(constant, k)), start)
                    )
                    for k in (axis, 3 + axis)
                )
                apart = builder.fsub(place, number(axis))
                relative = builder.fsub(velocity, number(3 + axis))
                if periodic:
                    apart = v.fused(relative, number(12), apart)
                if periodic and axis < 2:
                    whole = v.rounded(builder.fmul(apart, number(15 + axis)))
                    apart = v.fused(builder.fneg(whole), number(13 + axis), apart)
                square = v.sum(square, apart, apart)
                closing = v.sum(closing, apart, relative)
                speed = v.sum(speed, relative, relative)
            miss = v.fused(square, number(7), number(8))
            # equality counts: a touching pair may have the same velocity in float32
            may_meet = builder.fcmp_ordered(
                ">=", builder.fmul(closing, closing), builder.fmul(speed, miss)
            )
            approaching = builder.fcmp_ordered("<", v.fused(speed, number(6), closing), number(9))
            near = builder.and_(may_meet, approaching)
            if limited:  # at the end of the search the pair is within reach, or has passed by
                end = number(10)
                rate = v.fused(speed, end, closing)
                passed = builder.fcmp_ordered(">", rate, builder.fneg(number(9)))
                apart = v.fused(builder.fadd(rate, closing), end, square)
                in_reach = builder.fcmp_ordered("<=", apart, number(11))
                near = builder.and_(near, builder.or_(passed, in_reach))
            return v.mask(near)

        mask = near_of(first)
        for k in range(1, LANES // WIDTH):
            more = near_of(builder.add(first, ir.Constant(constant, k * WIDTH)))
            mask = builder.or_(mask, builder.shl(more, ir.Constant(more.type, k * WIDTH)))
        return mask

    return signature, codegen


@intrinsic
def _balls_near(
    typing_context: TypingContext, lanes: types.Type, first: types.Type, probe: types.Type
) -> _Function:
    return _near_filter(lanes, probe, limited=False)


@intrinsic
def _balls_near_until(
    typing_context: TypingContext, lanes: types.Type, first: types.Type, probe: types.Type
) -> _Function:
    return _near_filter(lanes, probe, limited=True)


@intrinsic
def _images_near(
    typing_context: TypingContext, lanes: types.Type, first: types.Type, probe: types.Type
) -> _Function:
    return _near_filter(lanes, probe, limited=False, periodic=True)


@intrinsic
def _images_near_until(
    typing_context: TypingContext, lanes: types.Type, first: types.Type, probe: types.Type
) -> _Function:
    return _near_filter(lanes, probe, limited=True, periodic=True)


def _balls_near_numpy(
    lanes: np.ndarray, first: int, probe: np.ndarray, limited: bool = False, periodic: bool = False
) -> int:
    block = lanes[:, first : first + LANES]
    with np.errstate(over="ignore", invalid="ignore"):
        apart = block[0:3] - probe[0:3, None]
        relative = block[3:6] - probe[3:6, None]
        if periodic:
            apart += relative * probe[12]
            apart[:2] -= np.rint(apart[:2] * probe[15:17, None]) * probe[13:15, None]
        square = (apart * apart).sum(axis=0)
        closing = (apart * relative).sum(axis=0)
        speed = (relative * relative).sum(axis=0)
        miss = square * probe[7] + probe[8]
        near = (closing * closing >= speed * miss) & (speed * probe[6] + closing < probe[9])
        if limited:
            rate = speed * probe[10] + closing
            near &= (rate > -probe[9]) | ((rate + closing) * probe[10] + square <= probe[11])
    bits = np.packbits(near, bitorder="little")
    return int.from_bytes(bits.tobytes(), "little")


@intrinsic
def _lowest_bit(typing_context: TypingContext, bits: types.Type) -> _Function:
    signature = types.int64(types.int64)

    def codegen(
        context: BaseContext, builder: ir.IRBuilder, _: Signature, arguments: Sequence[ir.Value]
    ) -> ir.Value:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return signature, codegen


def _lowest_bit_numpy(bits: int) -> int:
    return (int(bits) & -int(bits)).bit_length() - 1


@intrinsic
def _ticks(typing_context: TypingContext) -> _Function:
    signature = types.int64()

    def codegen(
        context: BaseContext, builder: ir.IRBuilder, _: Signature, arguments: Sequence[ir.Value]
    ) -> ir.Value:
        kind = ir.FunctionType(ir.IntType(64), [])
        return builder.call(
            cgutils.get_or_insert_function(builder.module, kind, "llvm.readcyclecounter"), []
        )

    return signature, codegen


Filter = Callable[..., int]

_settings: Any = numba.config
_plain = _settings.DISABLE_JIT

# boxes_hit(bounds, node, ray, longest, enter) -> bit mask of the children that a flight enters
#   bounds: boxes of the tree, shape (nodes, 6, 8) float32
#   ray: see detect/ball_mesh.py, shape (9,)
#   longest: end of the flight [s] float32
#   enter: entry times [s], shape (8,) float32, written
boxes_hit: Filter = _boxes_hit_numpy if _plain else _boxes_hit
# balls_near(lanes, first, probe) -> bit mask of the LANES balls that may meet the probe
#   lanes: positions and velocities, shape (6, n) float32
#   first: first lane
#   probe: shape (17,) float32
balls_near: Filter = _balls_near_numpy if _plain else _balls_near
# balls_near_until leaves out balls that cannot meet the probe before the time probe[10].
balls_near_until: Filter = partial(_balls_near_numpy, limited=True) if _plain else _balls_near_until
# images_near and images_near_until take the nearest images at the time probe[12], in a box with
# sides probe[13:15] along x and y, whose inverses are probe[15:17]. All other times count from
# probe[12].
images_near: Filter = partial(_balls_near_numpy, periodic=True) if _plain else _images_near
images_near_until: Filter = (
    partial(_balls_near_numpy, limited=True, periodic=True) if _plain else _images_near_until
)
lowest_bit: Callable[..., int] = _lowest_bit_numpy if _plain else _lowest_bit
# ticks() -> the processor's clock, in its own unit
ticks: Callable[..., int] = time.perf_counter_ns if _plain else _ticks
