"""From one received frame to the frames it causes: check, decode, align, observe, publish. Compiled."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus import e2e
from observer_rt.bus.alignment import Alignment, Placing, decide, place_block, store
from observer_rt.bus.codec import decode
from observer_rt.bus.e2e import E2EStatus
from observer_rt.bus.inputs import MAX_INPUTS, MAX_SIGNALS, ROLES, Inputs
from observer_rt.bus.multiplexing import is_selected
from observer_rt.config import Role
from observer_rt.observer.state import Observer
from observer_rt.observer.step import advance_stream, push
from observer_rt.service.publisher import Publisher, publish

MAX_COUNTER_STEP = 15  # larger steps of the E2E counter are a wrong sequence, not a few lost frames
_ACCEPTED = int(Placing.ACCEPTED)
_RESTARTED = int(Placing.RESTARTED)
_RAIL = ROLES.index(Role.RAIL_PRESSURE)
_LIFT = ROLES.index(Role.NEEDLE_LIFT)
_LINE = ROLES.index(Role.LINE_PRESSURE)

RECEIVER = np.dtype(
    [
        ("last_counter", np.int64, (MAX_INPUTS,)),  # of every message, -1: none yet
        (
            "interrupted",
            np.int8,
            (MAX_INPUTS,),
        ),  # of every stream, 1: its last frame is not the counter's last
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
    if not e2e.check(payload, message.length, message.e2e_profile, message.data_id):
        receiver.crc_errors += 1
        return
    counter = e2e.frame_counter(payload, message.e2e_profile)
    last = receiver.last_counter[number]
    max_step = min(MAX_COUNTER_STEP, e2e.counter_values(message.e2e_profile) // 2)
    status = e2e.classify(counter, last, last >= 0, max_step, message.e2e_profile)
    follows = message.e2e_profile != e2e.UNPROTECTED and status == E2EStatus.OK
    found, placed, restarted = 0, 0, False
    for g in range(message.first_group, message.first_group + message.group_count):
        group = pipeline.inputs.groups[g]
        if not is_selected(payload, pipeline.inputs.selection, group.first_condition, group.condition_count):
            continue
        found |= 1 << group.stream
        placing = _take_group(pipeline, group, payload, follows and receiver.interrupted[group.stream] == 0)
        if placing in (_ACCEPTED, _RESTARTED):
            placed |= 1 << group.stream
            restarted |= placing == _RESTARTED
    if found != 0 and placed == 0:
        return
    for g in range(message.first_group, message.first_group + message.group_count):
        stream = pipeline.inputs.groups[g].stream
        if (placed >> stream) & 1:
            receiver.interrupted[stream] = 0
        elif not follows:
            receiver.interrupted[stream] = 1
    if (
        not restarted
        and (status == E2EStatus.WRONG_SEQUENCE or status == E2EStatus.REPEATED)
        and message.e2e_profile != e2e.UNPROTECTED
    ):
        receiver.sequence_errors += 1
    receiver.last_counter[number] = counter
    decide(pipeline.alignment)
    _feed(pipeline)


@njit(cache=True, nogil=True)
def _take_group(pipeline: Pipeline, group, payload, contiguous):  # type: ignore[no-untyped-def]
    """Decode and align the samples of one group; contiguous: by the counter, since the stream's last frame."""
    values = pipeline.receiver[0].values
    table = pipeline.inputs.signals[group.first_signal : group.first_signal + group.signal_count]
    decode(payload, table, values)
    index = (int(values[0]) + group.offset) & 0xFFFFFFFF
    placing, start = place_block(pipeline.alignment, group.stream, index, group.samples, contiguous)
    if placing in (_ACCEPTED, _RESTARTED):
        for role in range(MAX_INPUTS):
            if (group.roles >> role) & 1:
                for k in range(group.samples):
                    value = values[group.position[role] + k]
                    store(pipeline.alignment, start + k, role, value * group.factor[role])
    return placing


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
