"""From one received frame to the frames it causes: check, decode, align, observe, publish. Compiled."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.alignment import Alignment, decide, store
from observer_rt.bus.alignment.placing import Placing, follow, place_block
from observer_rt.bus.alignment.timekeeping import (
    Count,
    Timekeeping,
    begin_anew,
    doubt_of,
    has_place,
    note_frame,
    number_frame,
    place_of,
)
from observer_rt.bus.database import e2e
from observer_rt.bus.database.codec import decode
from observer_rt.bus.database.e2e import E2EState, E2EStatus
from observer_rt.bus.database.multiplexing import is_selected
from observer_rt.bus.mapping.input_tables import MAX_INPUTS, MAX_SIGNALS, Inputs
from observer_rt.bus.mapping.timing import Joining, Numbering
from observer_rt.config.injector import E2EConfig
from observer_rt.foundation.compiled import inlined, inner, inner_separate
from observer_rt.foundation.referenced import referenced
from observer_rt.observer.stream.state import Observer
from observer_rt.observer.stream.step import advance_stream, take_recorded
from observer_rt.service.compiled.input_memory import InputMemory, take_inputs
from observer_rt.service.compiled.publisher import Publisher, publish

MAX_COUNTER_STEP = 15  # larger steps of the E2E counter are a wrong sequence, not a few lost frames

RECEIVER = np.dtype(
    [
        (
            "last_counter",
            np.int64,
            (MAX_INPUTS,),
        ),  # of every message's last frame that was placed, -1: none yet
        ("interrupted", np.int8, (MAX_INPUTS,)),  # of every stream, 1: its last frame is not the message's
        ("values", np.float64, (MAX_SIGNALS,)),
        ("sample", np.float64, (MAX_INPUTS,)),  # SI
        ("frames", np.int64),  # with samples, good or bad
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


def make_supervised(messages: NDArray[np.void], limits: E2EConfig) -> NDArray[np.void]:
    """State machines of input messages that have seen no frame, (messages,) `e2e.SUPERVISION`."""
    supervised = np.zeros(len(messages), e2e.SUPERVISION)
    supervised["counter"] = -1
    supervised["window"] = limits.window
    supervised["min_ok"] = [0, limits.init_min_ok, limits.valid_min_ok, limits.invalid_min_ok]
    supervised["max_errors"] = [0, limits.init_max_errors, limits.valid_max_errors, limits.invalid_max_errors]
    return supervised


@referenced()
class Pipeline(NamedTuple):
    """All memory of the receive-to-send path."""

    inputs: Inputs
    receiver: NDArray[np.void]  # (1,) RECEIVER
    supervised: NDArray[np.void]  # (messages,) e2e.SUPERVISION
    heard: InputMemory
    keeping: Timekeeping
    alignment: Alignment
    observer: Observer
    publisher: Publisher


@inlined
def handle(pipeline: Pipeline, key: int, payload: NDArray[np.uint8], stamp: int) -> bool:
    """Take one frame, received at `stamp` [ns]; `key` as by `frame_key.frame_key`.

    Frames caused are in the publisher's `out`. Returns True when Python must do something first, as of `proceed`.
    """
    for number in range(pipeline.inputs.messages.size):
        if pipeline.inputs.messages[number].key == key:
            _take(pipeline, number, payload, stamp)
            return bool(proceed(pipeline))
    return False


@inner
def listen(pipeline: Pipeline, key: int, payload: NDArray[np.uint8], stamp: int) -> None:
    """Take one frame as `handle` does, but observe nothing: its samples only go into the observer's ring."""
    for number in range(pipeline.inputs.messages.size):
        if pipeline.inputs.messages[number].key == key:
            _take(pipeline, number, payload, stamp)
            return


@inner_separate
def proceed(pipeline: Pipeline) -> bool:
    """Observe what is aligned and publish what is observed.

    Returns True when to go on it needs a new model (`InputMemory`), or the judgement of an event (`observer.judge`).
    """
    if pipeline.heard.memory[0].is_due:
        return True
    waiting = advance_stream(pipeline.observer)
    publish(pipeline.publisher, pipeline.observer)
    return bool(waiting)


@inner_separate
def _take(pipeline: Pipeline, number: int, payload: NDArray[np.uint8], stamp: int) -> None:
    """Check, decode and align one frame of an input message; what fails a check is counted and dropped."""
    receiver = pipeline.receiver[0]
    message = pipeline.inputs.messages[number]
    receiver.frames += message.group_count > 0
    status = _received(pipeline, number, payload)
    if status == E2EStatus.LENGTH_ERROR or status == E2EStatus.CRC_ERROR:
        return
    profile = message.protection.profile
    supervised = pipeline.supervised[number]
    if supervised.state == E2EState.INVALID:
        supervised.refused += 1
        return
    counter = e2e.frame_counter(payload, profile)
    if pipeline.inputs.optional.size > 0:
        take_inputs(pipeline.heard, pipeline.inputs, pipeline.observer, number, payload, status, stamp)
        pipeline.publisher.memory[0].learning = pipeline.heard.memory[0].learning
    if message.group_count == 0:
        return
    last = receiver.last_counter[number]
    status = e2e.classify(counter, last, last >= 0, _max_step(profile), profile)
    follows = profile != e2e.UNPROTECTED and status == E2EStatus.OK
    found, placed, restarted = 0, 0, False
    for g in range(message.first_group, message.first_group + message.group_count):
        group = pipeline.inputs.groups[g]
        if not is_selected(payload, pipeline.inputs.selection, group.first_condition, group.condition_count):
            continue
        found |= 1 << group.stream
        contiguous = follows and receiver.interrupted[group.stream] == 0
        placing = _take_group(pipeline, group, payload, counter, contiguous, stamp)
        if placing in (Placing.ACCEPTED, Placing.RESTARTED):
            placed |= 1 << group.stream
            restarted |= placing == Placing.RESTARTED
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
        and profile != e2e.UNPROTECTED
    ):
        receiver.sequence_errors += 1
    receiver.last_counter[number] = counter
    decide(pipeline.alignment)
    decided = pipeline.alignment.memory[0].decided
    if decided > pipeline.observer.memory[0].recorded:
        take_recorded(pipeline.observer, decided, doubt_of(pipeline.keeping))


@inner
def _received(pipeline: Pipeline, number: int, payload: NDArray[np.uint8]) -> E2EStatus:
    """What a frame is worth by its length and its protection, which takes note of it; OK without protection."""
    receiver, message = pipeline.receiver[0], pipeline.inputs.messages[number]
    supervised, profile = pipeline.supervised[number], message.protection.profile
    status = E2EStatus.OK
    if payload.size not in (message.length, message.padded_length):
        receiver.length_errors += 1
        status = E2EStatus.LENGTH_ERROR
    elif not e2e.check(payload, message.length, message.protection):
        receiver.crc_errors += 1
        status = E2EStatus.CRC_ERROR
    elif profile != e2e.UNPROTECTED:
        counter, last = e2e.frame_counter(payload, profile), supervised.counter
        status = e2e.classify(counter, last, last >= 0, _max_step(profile), profile)
        supervised.counter = counter
    if profile != e2e.UNPROTECTED:
        e2e.supervise(supervised, status)
    return status


@inner
def _max_step(profile: int) -> int:
    return int(min(MAX_COUNTER_STEP, e2e.counter_values(profile) // 2))


@inner_separate
def _take_group(pipeline: Pipeline, group, payload, counter, contiguous, stamp):  # type: ignore[no-untyped-def]
    """Decode and align the samples of one group: its `Placing`.

    counter: of the end-to-end protection; contiguous: it was without gap since the stream's last frame.
    """
    keeping = pipeline.keeping
    table = pipeline.inputs.signals[group.first_signal : group.first_signal + group.signal_count]
    decode(payload, table, pipeline.receiver[0].values)
    raw_index = _raw_index(pipeline, group, counter, stamp)
    if raw_index < 0:
        return Placing.OLD
    is_nearest = keeping.timing[group.stream].joining == Joining.NEAREST
    shift = keeping.shifts[group.stream].samples if is_nearest else 0
    placing, start = place_block(
        pipeline.alignment, group.stream, raw_index + shift, group.samples, contiguous
    )
    if placing in (Placing.ACCEPTED, Placing.RESTARTED):
        if placing == Placing.RESTARTED:
            begin_anew(keeping, group.stream)
        if not is_nearest:
            note_frame(keeping, group.stream, start + group.samples - 1, stamp)
        _store(pipeline, group, start)
    return placing


@inner_separate
def _raw_index(pipeline: Pipeline, group, counter, stamp):  # type: ignore[no-untyped-def]
    """Index of the group's first sample as sent or, where none is sent, as counted; -1: the frame is dropped."""
    keeping, stream = pipeline.keeping, group.stream
    timing = keeping.timing[stream]
    values = pipeline.receiver[0].values
    if timing.numbering == Numbering.INDEX:
        return (int(values[0]) + group.offset) & 0xFFFFFFFF
    sequence = 0
    if timing.numbering == Numbering.E2E_COUNTER:
        sequence = int(counter)
    elif timing.modulus > 1:
        if math.isnan(values[0]):
            return -1
        sequence = int(values[0])
    outcome = number_frame(keeping, stream, sequence, stamp)
    if outcome == Count.REPEATED:
        pipeline.alignment.memory[0].repeated += 1
        return -1
    if outcome == Count.OLD:
        pipeline.alignment.memory[0].old += 1
        return -1
    raw_index = keeping.counts[stream].number * group.samples
    if timing.joining == Joining.NEAREST:
        # its clock goes by its own count, which says where on the grid it belongs
        note_frame(keeping, stream, raw_index + group.samples - 1, stamp)
        if not has_place(keeping, stream):
            return -1
    return int(raw_index)


@inner_separate
def _store(pipeline: Pipeline, group, start):  # type: ignore[no-untyped-def]
    """The decoded samples of a group, the first of which is `start`, onto the grid."""
    receiver = pipeline.receiver[0]
    roles = pipeline.inputs.streams[group.stream].roles
    on_grid = pipeline.alignment.memory[0].streams[group.stream].on_grid
    follower = pipeline.alignment.memory[0].followers[group.stream]
    if not on_grid and not has_place(pipeline.keeping, group.stream):
        return
    for k in range(group.samples):
        for role in range(MAX_INPUTS):
            if (roles >> role) & 1:
                receiver.sample[role] = receiver.values[group.position[role] + k] * group.factor[role]
                if not (follower.roles >> role) & 1:
                    store(pipeline.alignment, start + k, role, receiver.sample[role])
        if follower.roles != 0:
            place = float(start + k) if on_grid else place_of(pipeline.keeping, group.stream, start + k)
            follow(pipeline.alignment, group.stream, place - follower.early, receiver.sample)
