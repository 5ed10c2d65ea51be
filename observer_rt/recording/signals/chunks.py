"""Chunks of a recording taken apart and put together."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import RunError
from observer_rt.recording.signals.recording import Chunk


class Bounds(Protocol):
    """Samples [start, end)."""

    @property
    def start(self) -> int: ...

    @property
    def end(self) -> int: ...


def cut(chunk: Chunk, start: int, end: int) -> Chunk:
    """Samples [start, end) of a chunk."""
    return replace(_each(chunk, lambda values: values[start:end]), first=chunk.first + start)


def copied(chunk: Chunk) -> Chunk:
    """The same samples without the larger chunk that they were cut from."""
    return _each(chunk, lambda values: values.copy())


def followed(before: Chunk, after: Chunk) -> Chunk:
    """A chunk and the one that follows it, as one."""

    def both(name: str) -> NDArray[np.float64]:
        return np.concatenate((getattr(before, name), getattr(after, name)))

    return replace(
        before,
        time=both("time"),
        rail_pressure=both("rail_pressure"),
        needle_lift=both("needle_lift"),
        line_pressure=both("line_pressure"),
        injection_rate=None if before.injection_rate is None else both("injection_rate"),
    )


def pieces(chunks: Iterable[Chunk], spans: Iterable[Bounds]) -> Iterator[Chunk]:
    """The samples of spans, which rise and do not overlap, from the chunks of one stretch; the rest is passed over.

    Raises `RunError` where the chunks end before the spans do.
    """
    waiting = iter(chunks)
    held: Chunk | None = None
    for span in spans:
        while held is None or held.first + held.samples < span.end:
            following = next(waiting, None)
            if following is None:
                raise RunError("the recording became shorter while it was read")
            done = 0 if held is None else span.start - held.first
            held = following if held is None or done >= held.samples else _rest(held, done, following)
        yield cut(held, span.start - held.first, span.end - held.first)


def _each(chunk: Chunk, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Chunk:
    rate = chunk.injection_rate
    return replace(
        chunk,
        time=change(chunk.time),
        rail_pressure=change(chunk.rail_pressure),
        needle_lift=change(chunk.needle_lift),
        line_pressure=change(chunk.line_pressure),
        injection_rate=None if rate is None else change(rate),
    )


def _rest(held: Chunk, done: int, following: Chunk) -> Chunk:
    return followed(cut(held, max(0, done), held.samples), following)
