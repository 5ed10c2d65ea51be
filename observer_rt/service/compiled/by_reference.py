"""The pipeline in the hands of compiled code: given once, then called by reference, with many frames at once.

A tuple of arrays that Python gives at every call would be laid out at every call, leaf by leaf, which takes longer
than the samples of a frame. Here its leaves are kept, and the machine code is called without a look at the types of
its arguments, which are always the same. It goes on as far as Python need not be asked.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numba import typeof, types
from numpy.typing import NDArray

from observer_rt.bus.links.link import FrameBlock
from observer_rt.foundation.compiled import compiled, inner_separate
from observer_rt.foundation.referenced import Kept
from observer_rt.observer.observer import with_constants
from observer_rt.observer.stream.state import Constants, Observer
from observer_rt.service.compiled.pipeline import Pipeline, handle, listen, proceed
from observer_rt.service.compiled.publisher import FRAMES

FULL = FRAMES // 4  # rate frames ready, beyond which there is room for those of one input frame only


@inner_separate
def take_many(pipeline: Pipeline, block: FrameBlock, first: int) -> tuple[int, bool]:
    """Take frames of a block from `first` on: number of the next one, and whether Python must do something first.

    Stops where taking them one by one would have Python do something: also when an event has closed or an input is to
    be read, when so many rates are ready that they must be collected, and after every frame where that is asked for.
    """
    memory = pipeline.heard.memory[0]
    closed = pipeline.observer.memory[0].events_closed
    for number in range(first, block.keys.size):
        payload = block.data[block.starts[number] : block.starts[number + 1]]
        if handle(pipeline, block.keys[number], payload, block.stamps[number]):
            return number + 1, True
        if (
            pipeline.observer.memory[0].events_closed != closed
            or pipeline.publisher.memory[0].frames >= FULL
            or memory.looks_at_each
            or memory.came != memory.read
        ):
            return number + 1, False
    return block.keys.size, False


@compiled
def _listen(pipeline: Pipeline, key: int, payload: NDArray[np.uint8], stamp: int) -> None:
    listen(pipeline, key, payload, stamp)


@compiled
def _take_many(pipeline: Pipeline, block: FrameBlock, first: int) -> tuple[int, bool]:
    number, waits = take_many(pipeline, block, first)
    return number, waits


@compiled
def _proceed(pipeline: Pipeline) -> bool:
    return bool(proceed(pipeline))


class CompiledPipeline:
    """The one owner of a pipeline; what it holds by value, the observer's constants, is replaced here only."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        """What compiled code works on now; not to be kept."""
        self.held = Kept(pipeline)
        """By which compiled code knows it; whoever is at work with it keeps it, while another takes its place."""

    @cached_property
    def _listen(self) -> Any:
        payload = types.Array(types.uint8, 1, "C")
        return _listen.compile((typeof(self.held), types.int64, payload, types.int64))

    @cached_property
    def _take_many(self) -> Any:
        numbers, payloads = types.Array(types.int64, 1, "C"), types.Array(types.uint8, 1, "C")
        block = types.NamedTuple((numbers, numbers, numbers, payloads), FrameBlock)
        return _take_many.compile((typeof(self.held), block, types.int64))

    @cached_property
    def _proceed(self) -> Any:
        return _proceed.compile((typeof(self.held),))

    @property
    def observer(self) -> Observer:
        """The pipeline's observer now; not to be kept."""
        return self.pipeline.observer

    def listen(self, key: int, payload: NDArray[np.uint8], stamp: int) -> None:
        """Take the samples of one frame without observing them: see `pipeline.listen`."""
        self._listen(self.held, key, payload, stamp)

    def take_many(self, block: FrameBlock, first: int) -> tuple[int, bool]:
        """Take frames of a block from `first` on: see `many.take_many`."""
        number, waits = self._take_many(self.held, block, first)
        return number, bool(waits)

    def proceed(self) -> bool:
        """Go on after a judgement or with another model: see `pipeline.proceed`."""
        return bool(self._proceed(self.held))

    def change_constants(self, constants: Constants) -> None:
        """Observe with other constants from here on."""
        self.pipeline = self.pipeline._replace(observer=with_constants(self.observer, constants))
        self.held = Kept(self.pipeline)
