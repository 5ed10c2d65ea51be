"""From one received frame to the frames it causes: check, decode, align, observe, publish. Compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus import e2e
from observer_rt.bus.alignment import Alignment, Placing, decide, place_block, store
from observer_rt.bus.codec import decode
from observer_rt.bus.e2e import E2EStatus
from observer_rt.bus.mapping import MAX_INPUTS, ROLES, Inputs
from observer_rt.config import Role
from observer_rt.observer.state import Observer
from observer_rt.observer.step import advance_stream, push
from observer_rt.service.publisher import Publisher, publish

MAX_COUNTER_STEP = 15  # larger steps of the E2E counter are a wrong sequence, not a few lost frames
MAX_SIGNALS = 256
_ACCEPTED = int(Placing.ACCEPTED)
_REPEATED = int(Placing.REPEATED)
_OLD = int(Placing.OLD)
_RAIL = ROLES.index(Role.RAIL_PRESSURE)
_LIFT = ROLES.index(Role.NEEDLE_LIFT)
_LINE = ROLES.index(Role.LINE_PRESSURE)

RECEIVER = np.dtype(
    [
        ("last_counter", np.int64, (MAX_INPUTS,)),  # -1: none yet
        ("values", np.float64, (MAX_SIGNALS,)),
        ("frames", np.int64),  # accepted as ours, good or bad
        ("crc_errors", np.int64),
        ("length_errors", np.int64),
        ("sequence_errors", np.int64),
    ],
    align=True,
)


def make_receiver() -> NDArray[np.void]:
    """Receiver that has seen no frame."""
    receiver = np.zeros(1, RECEIVER)
    receiver["last_counter"] = -1
    return receiver


class Pipeline(NamedTuple):
    """All memory of the receive-to-send path."""

    inputs: Inputs
    receiver: NDArray[np.void]  # (1,) RECEIVER
    alignment: Alignment
    observer: Observer
    publisher: Publisher


@njit(cache=True, nogil=True)
def handle(pipeline: Pipeline, key: int, payload: NDArray[np.uint8]) -> bool:
    """Take one frame; `key` as by `mapping.frame_key`.

    Frames caused are in the publisher's `out`. Returns True when the observer waits for the judgement of an
    event (`observer.judge`), after which `proceed` goes on.
    """
    for number in range(pipeline.inputs.messages.size):
        if pipeline.inputs.messages[number].key == key:
            _take(pipeline, number, payload)
            return bool(proceed(pipeline))
    return False


@njit(cache=True, nogil=True)
def proceed(pipeline: Pipeline) -> bool:
    """Observe what is aligned and publish what is observed; True when a judgement is needed to go on."""
    waiting = advance_stream(pipeline.observer)
    publish(pipeline.publisher, pipeline.observer)
    return bool(waiting)


@njit(cache=True, nogil=True)
def _take(pipeline: Pipeline, number: int, payload: NDArray[np.uint8]) -> None:
    """Check, decode and align one frame of an input message; what fails a check is counted and dropped."""
    receiver = pipeline.receiver[0]
    message = pipeline.inputs.messages[number]
    receiver.frames += 1
    if payload.size not in (message.length, message.padded_length):
        receiver.length_errors += 1
        return
    if message.data_id >= 0 and not e2e.check(payload, message.length, message.data_id):
        receiver.crc_errors += 1
        return
    table = pipeline.inputs.signals[message.first_signal : message.first_signal + message.signal_count]
    decode(payload, table, receiver.values)
    counter = payload[e2e.COUNTER_BYTE]
    last = receiver.last_counter[number]
    status = e2e.classify(counter, last, last >= 0, MAX_COUNTER_STEP)
    contiguous = message.data_id >= 0 and status == E2EStatus.OK
    placing, start = place_block(
        pipeline.alignment, number, int(receiver.values[0]), message.samples, contiguous
    )
    if placing in (_REPEATED, _OLD):
        return
    if (
        placing == _ACCEPTED
        and (status == E2EStatus.WRONG_SEQUENCE or status == E2EStatus.REPEATED)
        and message.data_id >= 0
    ):
        receiver.sequence_errors += 1
    receiver.last_counter[number] = counter
    for role in range(MAX_INPUTS):
        if (message.roles >> role) & 1:
            for k in range(message.samples):
                value = receiver.values[message.position[role] + k]
                store(pipeline.alignment, start + k, role, value * message.factor[role])
    decide(pipeline.alignment)
    _feed(pipeline)


@njit(cache=True, nogil=True)
def _feed(pipeline: Pipeline) -> None:
    """Hand the aligned samples to the observer."""
    alignment = pipeline.alignment.memory[0]
    for k in range(alignment.ready):
        row = pipeline.alignment.queue[k]
        push(
            pipeline.observer,
            row.index,
            row.values[_RAIL],
            row.values[_LIFT],
            row.values[_LINE],
            row.interpolated,
            row.broken,
        )
    alignment.ready = 0
