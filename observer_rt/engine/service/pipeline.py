"""Memory of the compiled path from a received frame to the frames it causes, and its one owner."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment import Alignment, Timekeeping
from observer_rt.bus.database import e2e
from observer_rt.bus.database.codec import SIGNAL
from observer_rt.bus.links.link import FrameBlock
from observer_rt.bus.mapping.input_tables import Inputs
from observer_rt.bus.mapping.output_messages import HEADER_SIGNALS, RateMessage
from observer_rt.config.injector import E2EConfig
from observer_rt.core.frames.frames import FRAMES, READINGS, RECORDS, FramePath
from observer_rt.engine.observer import with_constants
from observer_rt.engine.stream.state import Constants, Observer
from observer_rt.foundation.records import dtype_of

FULL = FRAMES // 4  # rate frames ready, beyond which there is room for those of one input frame only

RECEIVER = dtype_of(RECORDS["Receiver"])
OUT_FRAME = dtype_of(RECORDS["OutFrame"])
PUBLISHER = dtype_of(RECORDS["PublisherMemory"])
_VALUE = dtype_of(RECORDS["OptionalValue"])
_READING = dtype_of(RECORDS["Reading"])
_MEMORY = dtype_of(RECORDS["OptionalMemory"])


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


class InputMemory(NamedTuple):
    """Optional inputs as received; those whose order counts wait in a ring for Python."""

    memory: NDArray[np.void]  # (1,)
    newest: NDArray[np.void]  # (optional inputs,)
    readings: NDArray[np.void]  # (READINGS,)
    values: NDArray[np.float64]  # (READINGS, most signals of an input) SI


def make_input_memory(inputs: Inputs, may_learn: bool, fuel_temperature: float | None) -> InputMemory:
    """Memory of no inputs yet; fuel_temperature [K]: until it is measured, None: nothing is valid."""
    memory, newest = np.zeros(1, _MEMORY), np.zeros(len(inputs.optional), _VALUE)
    memory["newest"] = -1
    memory["may_learn"] = memory["learning"] = may_learn
    memory["measured"] = math.nan
    memory["fuel_temperature"] = math.nan if fuel_temperature is None else fuel_temperature
    memory["is_assumed"] = fuel_temperature is not None
    memory["since_change"] = math.inf
    newest["follows"] = True
    return InputMemory(
        memory,
        newest,
        np.zeros(READINGS, _READING),
        np.zeros((READINGS, int(inputs.optional["signal_count"].max(initial=0)))),
    )


class Publisher(NamedTuple):
    """Publisher of the observer's samples: every index once, in blocks that carry it.

    `out` holds `memory[0].frames` frames for the caller; values: the numbers to encode, the block's rates last.
    """

    memory: NDArray[np.void]  # (1,) PUBLISHER
    table: NDArray[np.void]  # SIGNAL
    values: NDArray[np.float64]
    out: NDArray[np.void]  # (FRAMES,) OUT_FRAME


def make_publisher(message: RateMessage | None, learning: bool) -> Publisher:
    """Publisher of blocks of rates in `message`; None: of nothing."""
    if message is None:
        return Publisher(np.zeros(1, PUBLISHER), np.zeros(0, SIGNAL), np.zeros(0), np.zeros(0, OUT_FRAME))
    names = message.page.names
    publisher = Publisher(
        np.zeros(1, PUBLISHER), message.page.table, np.full(len(names), np.nan), np.zeros(FRAMES, OUT_FRAME)
    )
    memory = publisher.memory[0]
    memory["learning"] = learning
    memory["header"] = [names.index(name) if name in names else -1 for name in HEADER_SIGNALS]
    memory["samples"] = message.samples
    memory["length"] = message.layout.length
    memory["protection"] = message.layout.protection
    return publisher


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
