"""Remembers what learning follows from event to event, as named values that a file can hold.

A tracker says by annotations of its class what it remembers, by these names: numbers, arrays, data classes, queues
of these, other trackers. What a name has no use for, in another version or of other sizes, is passed over.
"""

import json
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, get_origin, get_type_hints

import numpy as np
from pydantic import TypeAdapter

Remembered = Mapping[str, Any]
"""What a tracker remembers, by name: numbers, lists, mappings, and arrays, which a file holds as lists."""


@dataclass(frozen=True)
class Memory:
    """What was found in samples of an interval [s]."""

    interval: float
    found: Remembered


NOTHING = Memory(0.0, {})


class Tracker:
    """Follows something from event to event."""

    _hints: ClassVar[Mapping[str, Any]]

    def __init_subclass__(cls) -> None:
        hints = get_type_hints(cls)
        cls._hints = {name: hint for name, hint in hints.items() if get_origin(hint) is not ClassVar}

    def memory(self) -> Remembered:
        """What it remembers, as values of its own; nothing where they are not finite."""
        try:
            return {name: _plain(getattr(self, name), hint) for name, hint in self._hints.items()}
        except ValueError:
            return {}

    def recall(self, memory: Remembered) -> None:
        """Take back what was remembered, as far as there is use for it: of one tracker all, or nothing."""
        found: dict[str, Any] = {}
        try:
            for name, hint in self._hints.items():
                if name not in memory:
                    continue
                now = getattr(self, name)
                if isinstance(now, Tracker):
                    now.recall(memory[name])
                else:
                    found[name] = _as_now(memory[name], now, hint)
        except (ValueError, TypeError):
            return
        for name, value in found.items():
            setattr(self, name, value)


@cache
def _adapter(hint: Any) -> TypeAdapter[Any]:
    return TypeAdapter(hint)


def _plain(value: Any, hint: Any) -> Any:
    """The value as numbers, lists, mappings and a copied array. Raises ValueError where a number is not finite."""
    if isinstance(value, Tracker):
        return value.memory()
    if isinstance(value, np.ndarray):
        if not np.isfinite(value).all():
            raise ValueError(f"{value} is not finite")
        return value.copy()  # most of it lies in a few large ones, and only a file needs them as lists
    if isinstance(value, int | float | None):
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{value} is not finite")
        return value
    plain = _adapter(hint).dump_python(value, mode="json")
    json.dumps(plain, allow_nan=False)  # refuses what is not finite
    return plain


def _as_now(kept: Any, now: Any, hint: Any) -> Any:
    """What was kept, as it is now. Raises ValueError or TypeError where it is something else."""
    if get_origin(hint) is np.ndarray:
        array = np.array(kept, now.dtype)
        if array.shape != now.shape:
            raise ValueError(f"shape {array.shape} instead of {now.shape}")
        return array
    found = _adapter(hint).validate_python(kept)
    return deque(found, now.maxlen) if isinstance(now, deque) else found
