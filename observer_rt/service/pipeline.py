"""From one received frame to the frames it causes: check, decode, align, observe, publish. Compiled."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus import e2e
from observer_rt.bus.alignment import decide, store
from observer_rt.bus.alignment_memory import Alignment
from observer_rt.bus.codec import decode
from observer_rt.bus.counting import Count
from observer_rt.bus.e2e import E2EStatus
from observer_rt.bus.following import follow
from observer_rt.bus.mapping import MAX_INPUTS, ROLES, Inputs
from observer_rt.bus.placing import Placing, place_block
from observer_rt.bus.timekeeping import (
    Timekeeping,
    begin_anew,
    doubt_of,
    has_place,
    note_frame,
    number_frame,
    place_of,
)
from observer_rt.bus.timing import Joining, Numbering
from observer_rt.config import Role
from observer_rt.observer.state import Observer
from observer_rt.observer.step import advance_stream, push
from observer_rt.service.publisher import Publisher, publish

MAX_COUNTER_STEP = 15  # larger steps of the E2E counter are a wrong sequence, not a few lost frames
MAX_SIGNALS = 256
_ACCEPTED = int(Placing.ACCEPTED)
_REPEATED = int(Placing.REPEATED)
_OLD = int(Placing.OLD)
_RESTARTED = int(Placing.RESTARTED)
_COUNTED_REPEATED = int(Count.REPEATED)
_COUNTED_OLD = int(Count.OLD)
_BY_INDEX = int(Numbering.INDEX)
_BY_E2E_COUNTER = int(Numbering.E2E_COUNTER)
_NEAREST = int(Joining.NEAREST)
_RAIL = ROLES.index(Role.RAIL_PRESSURE)
_LIFT = ROLES.index(Role.NEEDLE_LIFT)
_LINE = ROLES.index(Role.LINE_PRESSURE)

RECEIVER = np.dtype(
    [
        ("last_counter", np.int64, (MAX_INPUTS,)),  # -1: none yet
        ("values", np.float64, (MAX_SIGNALS,)),
        ("sample", np.float64, (MAX_INPUTS,)),  # SI
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
    keeping: Timekeeping
    alignment: Alignment
    observer: Observer
    publisher: Publisher


@njit(cache=True, nogil=True)
def handle(pipeline: Pipeline, key: int, payload: NDArray[np.uint8], stamp: int) -> bool:
    """Take one frame, received at `stamp` [ns]; `key` as by `mapping.frame_key`.

    Frames caused are in the publisher's `out`. Returns True when the observer waits for the judgement of an
    event (`observer.judge`), after which `proceed` goes on.
    """
    for number in range(pipeline.inputs.messages.size):
        if pipeline.inputs.messages[number].key == key:
            _take(pipeline, number, payload, stamp)
            return bool(proceed(pipeline))
    return False


@njit(cache=True, nogil=True)
def proceed(pipeline: Pipeline) -> bool:
    """Observe what is aligned and publish what is observed; True when a judgement is needed to go on."""
    waiting = advance_stream(pipeline.observer)
    publish(pipeline.publisher, pipeline.observer)
    return bool(waiting)


@njit(cache=True, nogil=True)
def _take(pipeline: Pipeline, number: int, payload: NDArray[np.uint8], stamp: int) -> None:
    """Check, decode and align one frame of an input message; what fails a check is counted and dropped."""
    receiver = pipeline.receiver[0]
    message = pipeline.inputs.messages[number]
    timing = pipeline.keeping.timing[number]
    receiver.frames += 1
    if payload.size not in (message.length, message.padded_length):
        receiver.length_errors += 1
        return
    if message.data_id >= 0 and not e2e.check(payload, message.length, message.data_id):
        receiver.crc_errors += 1
        return
    table = pipeline.inputs.signals[message.first_signal : message.first_signal + message.signal_count]
    decode(payload, table, receiver.values)
    counter = payload[e2e.COUNTER_BYTE] if message.data_id >= 0 else 0
    last = receiver.last_counter[number]
    status = e2e.classify(counter, last, last >= 0, MAX_COUNTER_STEP)
    contiguous = message.data_id >= 0 and status == E2EStatus.OK
    raw_index = _raw_index(pipeline, number, counter, stamp)
    if raw_index < 0:
        return
    shift = pipeline.keeping.shifts[number].samples if timing.joining == _NEAREST else 0
    placing, start = place_block(pipeline.alignment, number, raw_index + shift, message.samples, contiguous)
    if placing in (_REPEATED, _OLD):
        return
    if (
        placing == _ACCEPTED
        and (status == E2EStatus.WRONG_SEQUENCE or status == E2EStatus.REPEATED)
        and message.data_id >= 0
    ):
        receiver.sequence_errors += 1
    receiver.last_counter[number] = counter
    if placing == _RESTARTED:
        begin_anew(pipeline.keeping, number)
    if timing.joining != _NEAREST:
        note_frame(pipeline.keeping, number, start + message.samples - 1, stamp)
    _store(pipeline, number, start)
    decide(pipeline.alignment)
    _feed(pipeline)


@njit(cache=True, nogil=True)
def _raw_index(pipeline: Pipeline, number: int, counter: int, stamp: int) -> int:
    """Index of the frame's first sample as sent or, where it sends none, as counted; -1: the frame is dropped."""
    keeping = pipeline.keeping
    timing = keeping.timing[number]
    values = pipeline.receiver[0].values
    if timing.numbering == _BY_INDEX:
        return int(values[0])
    sequence = 0
    if timing.numbering == _BY_E2E_COUNTER:
        sequence = int(counter)
    elif timing.modulus > 1:
        if math.isnan(values[0]):
            return -1
        sequence = int(values[0])
    outcome = number_frame(keeping, number, sequence, stamp)
    if outcome == _COUNTED_REPEATED:
        pipeline.alignment.memory[0].repeated += 1
        return -1
    if outcome == _COUNTED_OLD:
        pipeline.alignment.memory[0].old += 1
        return -1
    samples = pipeline.inputs.messages[number].samples
    raw_index = keeping.counts[number].number * samples
    if timing.joining == _NEAREST:
        # its clock goes by its own count, which says where on the grid it belongs
        note_frame(keeping, number, raw_index + samples - 1, stamp)
        if not has_place(keeping, number):
            return -1
    return int(raw_index)


@njit(cache=True, nogil=True)
def _store(pipeline: Pipeline, number: int, start: int) -> None:
    """The decoded samples of a frame, the first of which is `start`, onto the grid."""
    receiver = pipeline.receiver[0]
    message = pipeline.inputs.messages[number]
    on_grid = pipeline.alignment.memory[0].streams[number].on_grid
    if not on_grid and not has_place(pipeline.keeping, number):
        return
    for k in range(message.samples):
        for role in range(MAX_INPUTS):
            if (message.roles >> role) & 1:
                receiver.sample[role] = receiver.values[message.position[role] + k] * message.factor[role]
                if on_grid:
                    store(pipeline.alignment, start + k, role, receiver.sample[role])
        if not on_grid:
            follow(
                pipeline.alignment,
                number,
                place_of(pipeline.keeping, number, start + k),
                receiver.sample,
            )


@njit(cache=True, nogil=True)
def _feed(pipeline: Pipeline) -> None:
    """Hand the aligned samples to the observer."""
    alignment = pipeline.alignment.memory[0]
    doubt = doubt_of(pipeline.keeping)
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
            doubt,
        )
    alignment.ready = 0
