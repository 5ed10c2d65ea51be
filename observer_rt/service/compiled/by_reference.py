"""The pipeline in the hands of compiled code: given once, then called by reference, with many frames at once.

A tuple of arrays that Python gives at every call would be taken apart at every call, leaf by leaf, which takes longer
than the samples of a frame. Here it lies in a record of compiled code, and the machine code is called without a look
at the types of its arguments, which are always the same. It goes on as far as Python need not be asked.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numba import typeof, types
from numba.core.cgutils import create_struct_proxy
from numba.experimental import structref
from numba.extending import intrinsic, overload_attribute
from numpy.typing import NDArray

from observer_rt.bus.links.link import FrameBlock
from observer_rt.foundation.compiled import compiled, inner_separate
from observer_rt.foundation.referenced import Reference, reference_to
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


@structref.register
class _HeldType(types.StructRef):
    def preprocess_fields(self, fields):  # type: ignore[no-untyped-def]
        """Types of the fields, without the values of literals."""
        return tuple((name, types.unliteral(field)) for name, field in fields)


class _Held(structref.StructRefProxy):
    """A record of a pipeline that compiled code only reads, for it may be at work when another takes its place."""


structref.define_proxy(_Held, _HeldType, ["leaves"])


@compiled
def _hold(pipeline):  # type: ignore[no-untyped-def]
    return _Held(pipeline)


@intrinsic
def _pipeline_in(context: Any, held: Any) -> Any:
    """A `Reference` to what a record holds."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        record = create_struct_proxy(held)(context, builder, value=arguments[0])
        return reference_to(builder, context.nrt.meminfo_data(builder, record.meminfo))

    return Reference(held.field_dict["leaves"])(held), codegen


@overload_attribute(_HeldType, "pipeline")
def _pipeline(held):  # type: ignore[no-untyped-def]
    return lambda held: _pipeline_in(held)


@compiled
def _listen(held, key, payload, stamp):  # type: ignore[no-untyped-def]
    listen(held.pipeline, key, payload, stamp)


@compiled
def _take_many(held, block, first):  # type: ignore[no-untyped-def]
    return take_many(held.pipeline, block, first)


@compiled
def _proceed(held):  # type: ignore[no-untyped-def]
    return proceed(held.pipeline)


class CompiledPipeline:
    """The one owner of a pipeline; what it holds by value, the observer's constants, is replaced here only."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        """What compiled code works on now; not to be kept."""
        self.held = self._hold()
        """The record by which compiled code knows the pipeline."""

    def _hold(self) -> Any:
        held = _hold.compile((typeof(self.pipeline).tuple_type,))(self.pipeline)
        held.kept = self.observer.kept  # by who is at work with it, while another takes its place
        return held

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
        self.held = self._hold()
