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
from numba.extending import NativeValue, infer_getattr, intrinsic, register_model, typeof_impl, unbox
from numba.np.numpy_support import as_dtype
from numpy.typing import NDArray

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
    """To the leaves, which last as long as the call; made elsewhere, for every entry has this code."""
    make, its_kind = (c.pyapi.unserialize(c.pyapi.serialize_object(each)) for each in (_leaves, kind))
    native = c.pyapi.call_function_objargs(make, (value, its_kind))
    c.pyapi.decref(make)
    c.pyapi.decref(its_kind)
    is_error = cgutils.is_null(c.builder, native)
    place = cgutils.alloca_once_value(c.builder, cgutils.get_null_value(cgutils.voidptr_t))
    with c.builder.if_then(c.builder.not_(is_error)):
        c.builder.store(c.pyapi.bytes_as_string(native), place)
    return NativeValue(c.builder.load(place), is_error=is_error, cleanup=lambda: c.pyapi.decref(native))


class Kept:
    """A referenced tuple whose leaves are laid out once: for what is called often."""

    def __init__(self, value: Any) -> None:
        self.kind = typeof(value)
        self.leaves = _leaves(value, self.kind)
        self.value = value  # owns the arrays


@typeof_impl.register(Kept)
def _type_of_kept(value: Kept, context: Any) -> Reference:
    kind: Reference = value.kind
    return kind


def _leaves(value: Any, kind: Reference) -> bytes:
    """The leaves of a tuple, or those kept, as compiled code has them."""
    if isinstance(value, Kept):
        return value.leaves
    return np.array(_numbers(value, kind.tuple_type), _layout_of(kind)).tobytes()


def _numbers(value: Any, kind: Any) -> Any:
    """An element as numbers of its layout."""
    if isinstance(kind, types.BaseTuple):
        return tuple(map(_numbers, value, kind.types))
    if isinstance(kind, types.Array):
        return (0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides)
    return 0 if kind == types.none else value


@cache  # by the short name of the reference: tuple types take a millisecond to compare
def _layout_of(kind: Reference) -> np.dtype[Any]:
    return _layout(kind.tuple_type)


def _layout(kind: Any) -> np.dtype[Any]:
    """How an element lies in memory: as C would lay it; an array as its two owners, sizes and pointer."""
    if isinstance(kind, types.BaseTuple):
        return np.dtype([(str(place), _layout(each)) for place, each in enumerate(kind.types)], align=True)
    if isinstance(kind, types.Array):
        return np.dtype([(str(word), np.int64) for word in range(5 + 2 * kind.ndim)])
    return np.dtype(np.int64) if kind == types.none else as_dtype(kind)


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


class Bound(NamedTuple):
    """Where the code of a function begins, and the leaves of the tuple it is bound to."""

    code: int
    data: int


def bind(function: Any, value: Any) -> tuple[Bound, tuple[Any, NDArray[np.uint8]]]:
    """A compiled function (value, what, place) -> float bound to a referenced tuple; it raises nothing.

    And what must be kept while it may be called: of types that Numba's dispatcher knows at a glance.
    """
    signature = (typeof(value), types.int64, types.int64)
    function.compile(signature)
    found = function.overloads[signature]
    leaves = np.frombuffer(_leaves(value, typeof(value)), np.uint8)
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
