"""Messages of plain data between processes: JSON, and raw bytes for arrays. Reading one never executes anything.

A message is its length (8 bytes), JSON of that length, and the bytes of the arrays that the JSON names. It may hold
None, bool, int, float and str; lists, tuples (which come as lists) and dictionaries of these with keys of text; numpy
arrays of numbers, moments, text, or records of them.
"""

import json
import math
import re
import struct
from io import BufferedReader
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

_LENGTH = struct.Struct("<Q")
LONGEST_TEXT = 1 << 26  # bytes of JSON
_PLAIN_TYPE = re.compile(r"[<>|][biufmMSU]\d{1,9}(\[\d{0,9}\w+\])?")
_TYPE, _SHAPE, _FIELDS = "type", "shape", "fields"  # what stands for an array, and for a dictionary


class MessageError(Exception):
    """Bytes that are no message, or end within one."""


def write_message(stream: BinaryIO, value: Any) -> None:
    """Write a value. Raises `TypeError` for anything but plain data, before the first byte is written."""
    arrays: list[NDArray[Any]] = []
    text = json.dumps(_packed(value, arrays)).encode()
    if len(text) > LONGEST_TEXT:
        raise TypeError(f"{len(text)} bytes of text are too many at once: send arrays, or less")
    stream.write(_LENGTH.pack(len(text)) + text)
    for array in arrays:
        stream.write(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
    stream.flush()


def read_message(stream: BufferedReader, most_bytes: int) -> Any:
    """Read a value; most_bytes: of one array. Raises `EOFError` at the end, and `MessageError`."""
    start = stream.read(_LENGTH.size)
    if not start:
        raise EOFError
    try:
        (length,) = _LENGTH.unpack(start)
        if length > LONGEST_TEXT:
            raise MessageError(f"announces {length} bytes of text")
        return _unpacked(json.loads(stream.read(length)), stream, most_bytes)
    except (struct.error, ValueError, TypeError, LookupError, RecursionError, OverflowError, MemoryError) as error:
        raise MessageError(str(error)) from None


def _packed(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return [_packed(item, arrays) for item in value]
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return {_FIELDS: {key: _packed(item, arrays) for key, item in value.items()}}
    if isinstance(value, np.ndarray):
        described = np.lib.format.dtype_to_descr(value.dtype)
        _type_of(described)
        arrays.append(value)
        return {_TYPE: described, _SHAPE: value.shape}
    raise TypeError(f"{type(value).__name__} is no plain data: send numbers, text, lists, dictionaries or arrays")


def _unpacked(value: Any, stream: BufferedReader, most_bytes: int) -> Any:
    if isinstance(value, list):
        return [_unpacked(item, stream, most_bytes) for item in value]
    if not isinstance(value, dict):
        return value
    if _FIELDS in value:
        return {key: _unpacked(item, stream, most_bytes) for key, item in value[_FIELDS].items()}
    return _read_array(_type_of(value[_TYPE]), tuple(map(int, value[_SHAPE])), stream, most_bytes)


def _type_of(described: Any) -> np.dtype[Any]:
    """Type of the items, as `numpy.lib.format` describes it. Raises `TypeError` for one that is not plain."""
    if isinstance(described, list):
        return np.dtype([(name, _type_of(kind), *map(tuple, shape)) for name, kind, *shape in described])
    if not (isinstance(described, str) and _PLAIN_TYPE.fullmatch(described)):
        raise TypeError(f"an array of {described} is no plain data")
    return np.dtype(described)


def _read_array(kind: np.dtype[Any], shape: tuple[int, ...], stream: BufferedReader, most_bytes: int) -> NDArray[Any]:
    size = math.prod(shape) * kind.itemsize
    if min(shape, default=0) < 0 or size > most_bytes:
        raise MessageError(f"announces an array of {shape}")
    data = np.empty(size, np.uint8)
    position = 0
    while position < size:
        count = stream.readinto(data.data[position:])
        if not count:
            raise MessageError("ends within an array")
        position += count
    return data.view(kind).reshape(shape)
