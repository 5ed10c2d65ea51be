"""Named tuples that compiled code is given as one pointer, whatever they hold.

Numba passes a named tuple leaf by leaf, and counts the users of every array in it, atomically, at every call that it
does not inline. With a hundred leaves that is most of what the code does, of its size, and of the time to compile it.

Of what is reached by such a pointer nothing is counted: Python, who owns the tuple, must keep it while compiled code
runs. Its elements are read where they are used; one that is a referenced tuple, too, is a pointer again. What is
hidden of a tuple is not part of its type, so that the same code does for whatever it is.

Compiled functions bound to a tuple and called by address: a caller knows neither the function nor the tuple.

So what a caller is compiled for does not change with what it calls: an observer is the same code for every line.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    register_model,
    typeof_impl,
    unbox,
)
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled

_Kind = TypeVar("_Kind", bound=type)
_hidden_in: dict[type, tuple[str, ...]] = {}


class Reference(types.Type):
    """Type of the pointer; `tuple_type` of what it points to, by value."""

    def __init__(self, tuple_type: Any) -> None:
        self.tuple_type = tuple_type
        kind = tuple_type.instance_class
        # the whole name would be part of the name of every function that takes one
        digest = hashlib.sha256(f"{kind.__module__}.{tuple_type}".encode()).hexdigest()
        super().__init__(f"Reference({kind.__name__}, {digest[:24]})")

    def element(self, name: str) -> tuple[int, Any]:
        """Its place, and its type by value."""
        place = self.tuple_type.fields.index(name)
        return place, self.tuple_type.types[place]


def referenced(*hidden: str) -> Callable[[_Kind], _Kind]:
    """Class decorator: compiled code is given such named tuples by reference, from Python and from within others.

    hidden: elements compiled code does not see, as `name`, or as `name.name` of one within.
    """

    def register(kind: _Kind) -> _Kind:
        _hidden_in[kind] = hidden

        @typeof_impl.register(kind)
        def _type_of(value: Any, context: Any) -> Reference:
            return Reference(_type_by_value(value, context, ()))

        return kind

    return register


def _type_by_value(value: Any, context: Any, hidden: tuple[str, ...]) -> Any:
    if not isinstance(value, tuple):
        return typeof_impl(value, context)
    hidden = (*hidden, *_hidden_in.get(type(value), ()))
    names = getattr(value, "_fields", range(len(value)))
    elements = [
        types.none if name in hidden else _type_by_value(each, context, _within(hidden, name))
        for name, each in zip(names, value, strict=True)
    ]
    return types.BaseTuple.from_types(elements, type(value))


def _within(hidden: tuple[str, ...], name: str) -> tuple[str, ...]:
    return tuple(each.removeprefix(f"{name}.") for each in hidden if each.startswith(f"{name}."))


def _is_referenced(kind: Any) -> bool:
    return isinstance(kind, types.BaseNamedTuple) and kind.instance_class in _hidden_in


register_model(Reference)(models.OpaqueModel)


@unbox(Reference)
def _unbox(kind: Reference, value: Any, c: Any) -> NativeValue:
    """To a copy of the leaves that lasts as long as the call; made elsewhere, for every entry has this code."""
    make, its_kind = (c.pyapi.unserialize(c.pyapi.serialize_object(each)) for each in (_native, kind))
    native = c.pyapi.call_function_objargs(make, (value, its_kind))
    c.pyapi.decref(make)
    c.pyapi.decref(its_kind)
    is_error = cgutils.is_null(c.builder, native)
    place = cgutils.alloca_once_value(c.builder, cgutils.get_null_value(cgutils.voidptr_t))
    with c.builder.if_then(c.builder.not_(is_error)):
        c.builder.store(c.pyapi.bytes_as_string(native), place)
    return NativeValue(c.builder.load(place), is_error=is_error, cleanup=lambda: c.pyapi.decref(native))


def _native(value: Any, kind: Reference) -> bytes:
    """The leaves of a tuple as compiled code has them."""
    return bytes(_entry(kind)(value))


def leaves_of(value: Any) -> NDArray[np.uint8]:
    """The leaves of a referenced tuple as compiled code has them, where they stay."""
    return np.frombuffer(_native(value, typeof(value)), np.uint8)


@cache
def _entry(kind: Reference) -> Callable[[Any], NDArray[np.uint8]]:
    compiled: Any = _leaves
    entry: Callable[[Any], NDArray[np.uint8]] = compiled.compile((kind.tuple_type,))
    return entry


@compiled
def _leaves(value: Any) -> NDArray[np.uint8]:
    found = np.empty(_size(value), np.uint8)
    _write(found, value)
    return found


@intrinsic
def _size(typing_context: Any, value: Any) -> Any:
    """Bytes of a value."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.get_constant(types.intp, context.get_abi_sizeof(context.get_value_type(value)))

    return types.intp(value), codegen


@intrinsic
def _write(typing_context: Any, target: Any, value: Any) -> Any:
    """A value into an array of as many bytes."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(target)(context, builder, arguments[0]).data
        builder.store(arguments[1], builder.bitcast(data, context.get_value_type(value).as_pointer()))
        return context.get_dummy_value()

    return types.none(target, value), codegen


@infer_getattr
class _Elements(AttributeTemplate):
    key = Reference

    def generic_resolve(self, kind: Reference, name: str) -> Any:
        if name not in kind.tuple_type.fields:
            return None
        _, element = kind.element(name)
        return Reference(element) if _is_referenced(element) else element


@lower_getattr_generic(Reference)
def _element(context: Any, builder: Any, kind: Reference, value: Any, name: str) -> Any:
    place, element = kind.element(name)
    pointer = _typed(context, builder, kind, value)
    inner = cgutils.gep_inbounds(builder, pointer, 0, place)
    if _is_referenced(element):
        return builder.bitcast(inner, cgutils.voidptr_t)
    return _load(context, builder, element, inner)


def _typed(context: Any, builder: Any, kind: Reference, value: Any) -> Any:
    return builder.bitcast(value, context.get_value_type(kind.tuple_type).as_pointer())


def _load(context: Any, builder: Any, kind: Any, pointer: Any) -> Any:
    """What is there, of arrays without their owner; leaf by leaf, so that leaves that are not used go."""
    if isinstance(kind, types.BaseTuple):
        leaves = [
            _load(context, builder, leaf, cgutils.gep_inbounds(builder, pointer, 0, place))
            for place, leaf in enumerate(kind.types)
        ]
        return context.make_tuple(builder, kind, leaves)
    if not isinstance(kind, types.Array):
        return builder.load(pointer)
    there = context.make_array(kind)(context, builder, ref=pointer)
    array = context.make_array(kind)(context, builder)
    array.meminfo = cgutils.get_null_value(array.meminfo.type)
    array.parent = cgutils.get_null_value(array.parent.type)
    array.nitems, array.data = there.nitems, there.data
    array.itemsize = context.get_constant(
        types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype))
    )
    array.shape, array.strides = there.shape, there.strides
    return array._getvalue()


def reference_to(builder: Any, pointer: Any) -> Any:
    """For intrinsics: LLVM's value of a `Reference` from that of a pointer to the tuple by value."""
    return builder.bitcast(pointer, cgutils.voidptr_t)


class Bound(NamedTuple):
    """Where the code of a function begins, and the leaves of the tuple it is bound to."""

    code: int
    data: int


def bind(function: Any, value: Any) -> tuple[Bound, Any]:
    """A compiled function (value, what, place) -> float bound to a referenced tuple; it raises nothing.

    And what must be kept while it may be called.
    """
    signature = (typeof(value), types.int64, types.int64)
    function.compile(signature)
    found = function.overloads[signature]
    leaves = leaves_of(value)
    code = found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)
    return Bound(int(code), leaves.ctypes.data), (value, leaves)


@intrinsic
def call(typing_context: Any, bound: Any, what: Any, place: Any) -> Any:
    """What a bound function returns of two integers; for compiled code."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        code, data = (builder.extract_value(arguments[0], number) for number in range(2))
        integer, real = context.get_value_type(types.int64), context.get_value_type(types.float64)
        kind = ir.FunctionType(real, [cgutils.voidptr_t, integer, integer])
        function = builder.inttoptr(code, kind.as_pointer())
        return builder.call(function, [builder.inttoptr(data, cgutils.voidptr_t), arguments[1], arguments[2]])

    return types.float64(bound, types.int64, types.int64), codegen
