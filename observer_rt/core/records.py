"""What Python makes of the core's structs: dtypes of arrays lent to it, named tuples of numbers given to it."""

from collections import namedtuple
from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import Any

import numpy as np


def dtype_of(array: Any, fields: Mapping[str, Any]) -> np.dtype[np.void]:
    """Dtype of the arrays that the core takes as such structs; a single `unsigned char` is a bool.

    array: one of them, as Cython shows it; fields: the same by name.
    """
    return _dtype(np.asarray(memoryview(array)).dtype, fields)


def _dtype(described: np.dtype[Any], value: Any) -> np.dtype[Any]:
    if described.kind == "c":  # how the core shows a struct of two doubles
        return np.dtype([(name, np.float64) for name in value], align=True)
    if described == np.uint8:
        return np.dtype(np.bool_)
    if described.fields is None:
        return described
    fields = dict(described.fields)
    layout: Any = {
        "names": list(fields),
        "formats": [_dtype(field[0], value[name]) for name, field in fields.items()],
        "offsets": [field[1] for field in fields.values()],
        "itemsize": described.itemsize,
    }
    made: np.dtype[Any] = np.dtype(layout, align=True)
    return made


def tuple_of(module: str, name: str, fields: Mapping[str, Any]) -> type[tuple[Any, ...]]:
    """Named tuple, of a module, of the numbers in a struct, those of structs in it one after another."""
    return namedtuple(name, _names(fields), module=module)


def enum_of(module: str, name: str, **members: int) -> IntEnum:
    """Enum, of a module, of numbers that the core has."""
    return IntEnum(name, members, module=module)


def _names(fields: Mapping[str, Any]) -> Iterator[str]:
    for name, value in fields.items():
        yield from _names(value) if isinstance(value, Mapping) else (name,)
