"""Memory of the compiled path from a received frame to the frames it causes, and its one owner."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.alignment import Alignment
from observer_rt.bus.alignment.timekeeping import Timekeeping
from observer_rt.bus.database import e2e
from observer_rt.bus.links.link import FrameBlock
from observer_rt.bus.mapping.input_tables import Inputs
from observer_rt.config.injector import E2EConfig
from observer_rt.core.frames.frames import FRAMES, RECORDS, FramePath
from observer_rt.engine.observer import with_constants
from observer_rt.engine.service.input_memory import InputMemory
from observer_rt.engine.service.publisher import Publisher
from observer_rt.engine.stream.state import Constants, Observer
from observer_rt.foundation.records import dtype_of

FULL = FRAMES // 4  # rate frames ready, beyond which there is room for those of one input frame only

RECEIVER = dtype_of(RECORDS["Receiver"])


def make_receiver() -> NDArray[np.void]:
    """Receiver that has seen no frame."""
    receiver = np.zeros(1, RECEIVER)
    receiver["last_counter"] = -1
    return receiver


def make_supervised(messages: NDArray[np.void], limits: E2EConfig) -> NDArray[np.void]:
    """State machines of input messages that have seen no frame, (messages,) `e2e.SUPERVISION`."""
    supervised = np.zeros(len(messages), e2e.SUPERVISION)
    supervised["counter"] = -1
    supervised["window"] = limits.window
    supervised["min_ok"] = [0, limits.init_min_ok, limits.valid_min_ok, limits.invalid_min_ok]
    supervised["max_errors"] = [0, limits.init_max_errors, limits.valid_max_errors, limits.invalid_max_errors]
    return supervised


class Pipeline(NamedTuple):
    """All memory of the receive-to-send path."""

    inputs: Inputs
    receiver: NDArray[np.void]  # (1,) RECEIVER
    supervised: NDArray[np.void]  # (messages,) e2e.SUPERVISION
    input_memory: InputMemory
    keeping: Timekeeping
    alignment: Alignment
    observer: Observer
    publisher: Publisher


class CompiledPipeline:
    """The one owner of a pipeline; the observer's constants are replaced here only."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        """Memory that compiled code works on."""
        self.path = FramePath(
            pipeline.inputs,
            pipeline.receiver,
            pipeline.supervised,
            pipeline.input_memory,
            pipeline.keeping,
            pipeline.alignment,
            pipeline.observer.stream,
            pipeline.publisher,
        )

    @property
    def observer(self) -> Observer:
        """The pipeline's observer now; another one after the constants change."""
        return self.pipeline.observer

    def listen(self, key: int, payload: NDArray[np.uint8], stamp: int) -> None:
        """Take the samples of one frame without observing them."""
        self.path.listen(key, payload, stamp)

    def take_many(self, block: FrameBlock, first: int) -> tuple[int, bool]:
        """Take frames of a block from `first` on: number of the next, and whether Python must do something first."""
        return self.path.take_many(block.keys, block.stamps, block.starts, block.data, first, FULL)

    def proceed(self) -> bool:
        """Go on after a judgement or with another model; whether Python must do something first."""
        return self.path.proceed()

    def flush(self) -> None:
        """Ends the block of rates under way as a frame, not valid if anything is missing of it."""
        self.path.flush()

    def change_constants(self, constants: Constants) -> None:
        """Observe with other constants from here on; not while compiled code is at work with it."""
        if self.observer.constants.coefficients.valve.commanded:
            constants = constants.by_commands()
        self.pipeline = self.pipeline._replace(observer=with_constants(self.observer, constants))
