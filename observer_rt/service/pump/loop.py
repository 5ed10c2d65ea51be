"""The pump's loop, compiled: frames from sockets through the pipeline, rates back onto the bus. It never asks Python.

One turn: frames that wait, of several buses the earliest first; each through the pipeline; what it caused is sent.
With one bus and nothing to send late, a turn is two system calls.
"""

from collections.abc import Callable

import numpy as np
from numba import types
from numpy.typing import NDArray

from observer_rt.bus.can_frame import BUS as BUS_KEY
from observer_rt.bus.can_frame import (
    ERROR_FLAG,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    FD_MTU,
    HEADER_BYTES,
    REMOTE_FLAG,
    STANDARD_MASK,
)
from observer_rt.bus.can_frame import EXTENDED as EXTENDED_KEY
from observer_rt.bus.links.socketcan import SO_RXQ_OVFL, SO_TIMESTAMPING, SO_TIMESTAMPNS
from observer_rt.foundation.compiled import compiled, inner
from observer_rt.foundation.referenced import Kept
from observer_rt.observer.stream.state import Observer
from observer_rt.service.compiled.pipeline import Pipeline, handle, proceed
from observer_rt.service.compiled.publisher import Publisher
from observer_rt.service.pump import libc
from observer_rt.service.pump.memory import BATCH, CONTROL_WORDS, ERRORS, SLOT, WAITING, Pump

WAIT_MS = 20  # longest time deaf to Python
RETRY_MS = 1  # a full transmit queue cannot be polled for
_SECOND = 1_000_000_000

_recvmmsg, _send, _write, _poll = libc.recvmmsg, libc.send, libc.write, libc.poll
_clock_gettime, _errno_location = libc.clock_gettime, libc.errno_location


def compiled_for(pump: Kept, pipeline: Kept) -> Callable[..., bool]:
    """`run` for a pump and a pipeline, compiled or loaded from the cache."""
    entry: Callable[..., bool] = run.compile((pump.kind, pipeline.kind, types.int64))
    return entry


@compiled
def run(pump: Pump, pipeline: Pipeline, wake: int) -> bool:
    """Pump until asked to stop, or until Python must do something first: True. Call it again then.

    wake: descriptor written to when something happened that Python waits for.
    """
    memory = pump.memory[0]
    waits = proceed(pipeline)  # with what it waited for
    send_rates(pump, pipeline.publisher)
    if waits:
        return True
    while not memory.is_to_stop:
        memory.turns += 1
        if not _frame_is_there(pump):
            _receive(pump)
        while True:
            bus = _earliest(pump)
            if bus < 0:
                break
            if _take(pump, pipeline, bus):
                return True
        if memory.first_waiting < memory.end_waiting:
            _send_waiting(pump)
        _tell(pump, pipeline.observer, wake)
    return False


@inner
def send_rates(pump: Pump, publisher: Publisher) -> None:
    """Send the frames that the publisher has ready; what there is no room for waits, the oldest are given up."""
    memory = pump.memory[0]
    ready = publisher.memory[0]
    for number in range(ready.frames):
        if memory.end_waiting - memory.first_waiting == WAITING:
            memory.first_waiting += 1
            memory.unsent += 1
        place = (memory.end_waiting % WAITING) * FD_MTU
        frame = pump.waiting[place : place + FD_MTU]
        identifier = memory.identifier
        for byte in range(4):
            frame[byte] = (identifier >> (8 * byte)) & 0xFF
        row = publisher.out[number]
        frame[4] = row.length
        frame[5] = memory.flags
        for byte in range(row.length):
            frame[HEADER_BYTES + byte] = row.payload[byte]
        memory.end_waiting += 1
    ready.frames = 0
    if memory.first_waiting < memory.end_waiting:
        _send_waiting(pump)


@inner
def _send_waiting(pump: Pump) -> None:
    """Send in order, as far as there is room; what waits when the bus goes down would be old when it is back."""
    memory = pump.memory[0]
    bus = pump.buses[memory.bus]
    while memory.first_waiting < memory.end_waiting:
        sent = -1
        if bus.failure == 0:
            address = pump.waiting.ctypes.data + (memory.first_waiting % WAITING) * FD_MTU
            sent = _send(bus.fd, address, memory.size, libc.MSG_DONTWAIT)
        if sent >= 0:
            memory.first_waiting += 1
            continue
        error = _errno_location()[0]
        if bus.failure == 0 and error == libc.EINTR:
            continue
        if bus.failure == 0 and (error == libc.EAGAIN or error == libc.ENOBUFS):
            return
        if bus.failure == 0:
            bus.failure = error
        memory.unsent += memory.end_waiting - memory.first_waiting
        memory.first_waiting = memory.end_waiting


@inner
def _frame_is_there(pump: Pump) -> bool:
    for number in range(pump.buses.size):
        bus = pump.buses[number]
        if bus.failure == 0 and bus.next < bus.count:
            return True
    return False


@inner
def _receive(pump: Pump) -> None:
    """Wait for frames of any bus, and take those that are there."""
    memory = pump.memory[0]
    is_late = memory.first_waiting < memory.end_waiting
    if pump.buses.size == 1 and pump.buses[0].failure == 0 and not is_late:
        _fill(pump, 0, libc.MSG_WAITFORONE)
        return
    for number in range(pump.buses.size):
        bus = pump.buses[number]
        pump.polled[number].fd = bus.fd if bus.failure == 0 else -1  # which poll leaves out
        pump.polled[number].revents = 0
    _poll(pump.polled.ctypes.data, pump.buses.size, RETRY_MS if is_late else WAIT_MS)
    for number in range(pump.buses.size):
        if pump.polled[number].revents != 0:
            _fill(pump, number, libc.MSG_DONTWAIT)


@inner
def _fill(pump: Pump, number: int, flags: int) -> None:
    """Take a batch of frames of a bus."""
    bus = pump.buses[number]
    first = number * BATCH
    for place in range(first, first + BATCH):
        pump.headers[place].control_length = CONTROL_WORDS * 8
    got = _recvmmsg(bus.fd, pump.headers.ctypes.data + first * pump.headers.itemsize, BATCH, flags, 0)
    bus.next = 0
    bus.count = max(got, 0)
    if got < 0:
        error = _errno_location()[0]
        if error != libc.EAGAIN and error != libc.EINTR:
            bus.failure = error
    else:
        _note_stamp(pump, number)


@inner
def _earliest(pump: Pump) -> int:
    """The bus whose next frame is the earliest of those that wait; -1: none waits."""
    earliest = -1
    for number in range(pump.buses.size):
        bus = pump.buses[number]
        if bus.failure != 0:
            continue
        if bus.next >= bus.count:
            if pump.buses.size > 1:
                _fill(pump, number, libc.MSG_DONTWAIT)
            if bus.next >= bus.count:
                continue
        if earliest < 0 or bus.stamp < pump.buses[earliest].stamp:
            earliest = number
    return earliest


@inner
def _note_stamp(pump: Pump, number: int) -> None:
    """The stamp of a bus's next frame, and what the kernel says of lost ones."""
    bus = pump.buses[number]
    if bus.next >= bus.count:
        return
    place = number * BATCH + bus.next
    if pump.headers[place].length == SLOT:
        bus.stamp = pump.stamps[(place + 1) * SLOT // 8 - 1]
        return
    words = pump.control[place * CONTROL_WORDS : (place + 1) * CONTROL_WORDS]
    end = pump.headers[place].control_length // 8
    stamp = 0
    at = 0
    while at + 2 < end and words[at] > 16:
        kind = words[at + 1] >> 32
        if words[at + 1] & 0xFFFFFFFF != libc.SOL_SOCKET:
            pass
        elif kind == SO_TIMESTAMPNS:
            stamp = words[at + 2] * _SECOND + words[at + 3]
        elif kind == SO_TIMESTAMPING:
            by_kernel = words[at + 2] * _SECOND + words[at + 3]
            by_interface = words[at + 6] * _SECOND + words[at + 7]
            stamp = by_kernel
            if by_interface != 0:
                if not bus.has_offset:
                    bus.offset = (
                        by_kernel if by_kernel != 0 else _now(pump, libc.CLOCK_REALTIME)
                    ) - by_interface
                    bus.has_offset = True
                stamp = by_interface + bus.offset
        elif kind == SO_RXQ_OVFL:
            bus.overflows = words[at + 2] & 0xFFFFFFFF
        at += (words[at] + 7) // 8
    bus.stamp = stamp if stamp != 0 else _now(pump, libc.CLOCK_REALTIME)


@inner
def _take(pump: Pump, pipeline: Pipeline, number: int) -> bool:
    """Take the next frame of a bus through the pipeline: whether Python must do something first."""
    bus = pump.buses[number]
    place = number * BATCH + bus.next
    if pump.headers[place].length == 0:  # a pair of sockets whose other end was closed
        bus.failure = libc.ENODEV
        return False
    identifier = pump.words[place * SLOT // 4]
    data = place * SLOT + HEADER_BYTES
    length = pump.frames[data - 4]
    payload = pump.frames[data : data + length]
    key = number * BUS_KEY
    if identifier & EXTENDED_FLAG:
        key += (identifier & EXTENDED_MASK) + EXTENDED_KEY
    else:
        key += identifier & STANDARD_MASK
    stamp = bus.stamp
    bus.next += 1
    _note_stamp(pump, number)
    if identifier & (ERROR_FLAG | REMOTE_FLAG):
        if identifier & ERROR_FLAG:
            _note_error(pump, number, identifier, payload)
        return False
    waits = handle(pipeline, key, payload, stamp)
    send_rates(pump, pipeline.publisher)
    _note_arrival(pump, key)
    return bool(waits)


@inner
def _note_arrival(pump: Pump, key: int) -> None:
    """Of a frame that is watched; once its rates are sent, for asking for the time may be a system call."""
    for watched in range(pump.arrivals.size):
        arrival = pump.arrivals[watched]
        if arrival.key == key:
            arrival.last = _now(pump, libc.CLOCK_MONOTONIC)
            arrival.frames += 1
            break


@inner
def _note_error(pump: Pump, number: int, identifier: int, data: NDArray[np.uint8]) -> None:
    """Keep an error frame for Python."""
    bus = pump.buses[number]
    error = pump.errors[number * ERRORS + bus.errors % ERRORS]
    error.identifier = identifier
    error.length = min(data.size, 8)
    for byte in range(error.length):
        error.data[byte] = data[byte]
    bus.errors += 1


@inner
def _now(pump: Pump, clock: int) -> int:
    """Time of a clock [ns]."""
    _clock_gettime(clock, pump.clock.ctypes.data)
    return int(pump.clock[0] * _SECOND + pump.clock[1])


@inner
def _tell(pump: Pump, observer: Observer, wake: int) -> None:
    """Wake Python when something happened that it waits for."""
    memory = pump.memory[0]
    stream = observer.memory[0]
    reported = stream.events_closed + stream.events_taken
    for number in range(pump.buses.size):
        bus = pump.buses[number]
        reported += bus.errors + (bus.failure != 0)
    if reported != memory.reported:
        memory.reported = reported
        _write(wake, pump.event.ctypes.data, 8)
