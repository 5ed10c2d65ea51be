"""Vectors and matrices of a few numbers, for compiled code: the libraries' take longer to begin, and to compile.

Several numbers in one are for loops over the columns of a few rows, or over samples. What LLVM makes of such a loop
by itself hangs on whether it can prove that its arrays do not overlap, and a sum over samples it leaves as it is. A
vector is reckoned with as a number is; it stands for `WIDTH` neighbours.
"""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, overload, register_model
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined, inner


@inlined
def copy_vector(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """All numbers of one (n,) into the other."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@inlined
def copy_matrix(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """All numbers of one (n, m) into the other."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@compiled
def ascending(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Places of a few values (n,) in ascending order, equal ones as they come."""
    order = np.arange(values.shape[0])
    for k in range(1, order.shape[0]):
        place, i = order[k], k
        while i > 0 and values[order[i - 1]] > values[place]:
            order[i] = order[i - 1]
            i -= 1
        order[i] = place
    return order


@inner
def multiply(left: NDArray[np.float64], right: NDArray[np.float64], result: NDArray[np.float64]) -> None:
    """left (n, k) @ right (k, m) into `result` (n, m), another array; what is 0 in `left` costs nothing."""
    for i in range(result.shape[0]):
        for j in range(result.shape[1]):
            result[i, j] = 0.0
        for k in range(right.shape[0]):
            factor = left[i, k]
            if factor != 0.0:
                for j in range(result.shape[1]):
                    result[i, j] += factor * right[k, j]


@inner
def propagate(
    transition: NDArray[np.float64],
    covariance: NDArray[np.float64],
    moved: NDArray[np.float64],
    scratch: NDArray[np.float64],
) -> None:
    """transition @ covariance into `moved`, and that @ transition.T into `covariance`; all (m, m).

    The transition of a line of cells is nearly empty, and always on the left here.
    """
    multiply(transition, covariance, moved)
    for i in range(moved.shape[0]):
        for j in range(moved.shape[0]):
            scratch[i, j] = moved[j, i]
    multiply(transition, scratch, covariance)
    for i in range(moved.shape[0]):
        for j in range(i):
            covariance[i, j], covariance[j, i] = covariance[j, i], covariance[i, j]


@inner
def product(matrix: NDArray[np.float64], vector: NDArray[np.float64], row: int) -> float:
    """A row of a matrix times a vector."""
    total = 0.0
    for k in range(vector.shape[0]):
        total += matrix[row, k] * vector[k]
    return total


WIDTH = 8
_IR = ir.VectorType(ir.DoubleType(), WIDTH)
_ALIGNMENT = 8  # bytes, of a number


class _Vector(types.Type):
    def __init__(self) -> None:
        super().__init__(name=f"Vector({WIDTH})")


_VECTOR = _Vector()


@register_model(_Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: _Vector) -> None:
        super().__init__(manager, kind, _IR)


def whole_vectors(count: int) -> int:
    """So many numbers, or as many more as fill vectors."""
    return -(-count // WIDTH) * WIDTH


@intrinsic
def load(typing_context: Any, array: Any, place: Any) -> Any:
    """The vector at a place of a contiguous array, counted in numbers."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_pointer(context, builder, signature, arguments), align=_ALIGNMENT)

    return _VECTOR(array, types.intp), codegen


@intrinsic
def store(typing_context: Any, array: Any, place: Any, vector: Any) -> Any:
    """A vector into a contiguous array, at a place counted in numbers."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _pointer(context, builder, signature, arguments), align=_ALIGNMENT)

    return types.void(array, types.intp, vector), codegen


def _pointer(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.bitcast(builder.gep(array.data, [arguments[1]]), _IR.as_pointer())


@intrinsic
def filled(typing_context: Any, number: Any) -> Any:
    """A vector of one number."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        nothing, first = ir.Constant(_IR, ir.Undefined), ir.Constant(ir.IntType(32), 0)
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
        return builder.shuffle_vector(builder.insert_element(nothing, arguments[0], first), nothing, lanes)

    return _VECTOR(types.float64), codegen


@intrinsic
def sum_of(typing_context: Any, vector: Any) -> Any:
    """The sum of a vector's numbers, in their order."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        numbers = [
            builder.extract_element(arguments[0], ir.Constant(ir.IntType(32), i)) for i in range(WIDTH)
        ]
        total = numbers[0]
        for number in numbers[1:]:
            total = builder.fadd(total, number)
        return total

    return types.float64(vector), codegen


def _give(function: Callable[..., Any], of_numbers: Callable[[Any, Any, Any], Any]) -> None:
    """Let compiled code apply a function of two numbers to vectors, or to a vector and a number.

    of_numbers: LLVM's instructions, from a builder and two vectors.
    """

    @intrinsic
    def of_vectors(typing_context: Any, left: Any, right: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return of_numbers(builder, *arguments)

        return _VECTOR(left, right), codegen

    @overload(function, strict=False)
    def compiled(left: Any, right: Any) -> Any:
        kinds = isinstance(left, _Vector), isinstance(right, _Vector)
        if kinds == (True, True):
            return lambda left, right: of_vectors(left, right)
        if kinds == (False, True) and isinstance(left, types.Float):
            return lambda left, right: of_vectors(filled(left), right)
        if kinds == (True, False) and isinstance(right, types.Float):
            return lambda left, right: of_vectors(left, filled(right))
        return None


_give(operator.add, lambda builder, left, right: builder.fadd(left, right))
_give(operator.sub, lambda builder, left, right: builder.fsub(left, right))
_give(operator.mul, lambda builder, left, right: builder.fmul(left, right))
_give(operator.truediv, lambda builder, left, right: builder.fdiv(left, right))
_give(min, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", a, b), a, b))
_give(max, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", a, b), a, b))
