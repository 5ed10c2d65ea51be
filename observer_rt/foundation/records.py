"""Records: frozen data classes as named values that a file can hold, and back.

Fields keep their names: numbers, arrays, tuples of these, other such classes. Fields marked `NOT_KEPT` belong to one
run only.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache, partial
from types import NoneType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

NOT_KEPT: Mapping[str, Any] = {"kept": False}
"""Metadata of a field that no file holds."""
_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)
_hints: Callable[[type], Mapping[str, Any]] = cache(partial(get_type_hints, include_extras=True))

Count = Annotated[int, Field(ge=0, lt=1 << 53)]


class NotAsExpectedError(ValueError):
    """A stored value does not fit its field's type."""


def kept_names(kind: type) -> Iterator[str]:
    """Names of the fields of a data class that a file holds."""
    return (field.name for field in fields(kind) if field.metadata.get("kept", True))


def to_plain(value: Any) -> Any:
    """Convert a value to numbers, lists, mappings and arrays; JSON then holds the arrays as lists."""
    if is_dataclass(value):
        return {name: to_plain(getattr(value, name)) for name in kept_names(type(value))}
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple):
        return [to_plain(each) for each in value]
    return value


def from_plain(hint: Any, value: Any, like: Any = None, location: str = "") -> Any:
    """Convert a value of `to_plain` back to `hint`, shaped `like` another if given. Raises `NotAsExpectedError`."""
    if NoneType in get_args(hint):
        hint = next(each for each in get_args(hint) if each is not NoneType)
        if value is None:
            return None
    if get_origin(hint) is np.ndarray:
        return _array(value, get_args(get_args(hint)[1])[0], like, location)
    args = get_args(hint)
    if get_origin(hint) is tuple and args[-1] is ... and is_dataclass(args[0]) and isinstance(value, list):
        likes = like or (None,)
        return tuple(from_plain(args[0], each, likes[0], f"{location}.{i}") for i, each in enumerate(value))
    if not is_dataclass(hint):
        try:
            return _adapter(hint).validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            raise NotAsExpectedError(f"{location}: {error.errors()[0]['msg']}") from None
    assert isinstance(hint, type)
    names, hints = tuple(kept_names(hint)), _hints(hint)
    if not isinstance(value, Mapping) or not value.keys() <= set(names):
        raise NotAsExpectedError(f"{location}: its names must be among {', '.join(names)}")
    fields = {
        name: from_plain(hints[name], value[name], getattr(like, name, None), f"{location}.{name}".lstrip("."))
        for name in names
        if name in value
    }
    try:
        return hint(**fields)
    except TypeError as error:
        raise NotAsExpectedError(f"{location}: {error}") from None


def _array(value: Any, kind: Any, like: Any, location: str) -> Any:
    try:
        array = np.array(value, kind)
    except (ValueError, TypeError) as error:
        raise NotAsExpectedError(f"{location}: {error}") from None
    if like is not None and like.size and array.shape != like.shape:
        raise NotAsExpectedError(f"{location}: shape {array.shape} instead of {like.shape}")
    return array
