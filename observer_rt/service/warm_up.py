"""Compile, or load from the cache, everything the loop and the training call, before the first frame needs it."""

import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from itertools import chain
from threading import Event

import numpy as np

from observer_rt.bus.database.e2e import UNPROTECTED, protect
from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import RunError
from observer_rt.recording.replay.framing import Framer, TimedFrame, whole
from observer_rt.service.core.core import Core
from observer_rt.service.learning_ahead import learning_compiled_beside
from observer_rt.service.own_injections import own_injections
from observer_rt.service.pump.pump import FramePump
from observer_rt.service.watch.arrivals import Arrivals

_TURN = 1e-3  # s that the pump is served for at a time
_MOST_IDLE = 10_000  # turns in which no frame comes through: some ten seconds, after which none will


def warm_up(bench: Bench, bus: BusMap, stop: Event | None = None) -> Core:
    """Take the bench's model through a few injections of its own, frames, training and results included.

    Code that is only compiled is still to be loaded, linked and its branches still to be met: a first real event
    after that took ten times as long as the next. Returns the core that was used up. Once `stop` is set the rest is
    left out. Raises `RunError` when a frame does not come through.
    """
    stop = stop or Event()
    with learning_compiled_beside(bench.injector, stop) as wait:
        core = Core(bench.injector, bus)
        if not stop.is_set():
            core.compiled.proceed()  # compiled now, and not while another process is waited for
        if stop.is_set():
            return core
        _pump(core, bus, len(bench.config.buses), lambda: _frames(bench, bus, wait, stop), stop)
    return core


def _frames(bench: Bench, bus: BusMap, wait: Callable[[], object], stop: Event) -> list[TimedFrame]:
    """What is sent, once another process has done what it was to do; nothing where that was stopped."""
    wait()
    if stop.is_set():
        return []
    recording = own_injections(bench.injector)
    return [*Framer(bus).frames(recording, whole(recording)), *_slow_frames(bus)]


def _slow_frames(bus: BusMap) -> Iterator[TimedFrame]:
    """One of every message with optional inputs."""
    for layout in (slow.layout for slow in bus.slow):
        payload = np.zeros(layout.length, np.uint8)
        protect(payload, layout.length, layout.e2e_profile or UNPROTECTED, layout.e2e_data_id or 0, 0)
        identifier, is_extended = layout.frame_id, layout.is_extended
        yield TimedFrame(0.0, identifier, is_extended, layout.is_fd, payload.tobytes(), bus=layout.bus)


def _pump(
    core: Core, bus: BusMap, buses: int, frames_to_send: Callable[[], list[TimedFrame]], stop: Event
) -> None:
    """Frames through sockets and the compiled loop, which is compiled before they are asked for."""
    with ExitStack() as stack:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(buses)]
        for end in chain.from_iterable(pairs):
            stack.enter_context(end)
            end.setblocking(False)
        links = [
            stack.enter_context(DescriptorLink(str(ours.fileno()), True, bus.received_on(number)))
            for number, (ours, _) in enumerate(pairs)
        ]
        devices = [
            stack.enter_context(DescriptorLink(str(theirs.fileno()), True, None)) for _, theirs in pairs
        ]
        arrivals = Arrivals(bus)
        pump = FramePump(links, core, bus, arrivals)
        stack.callback(pump.close)
        frames = frames_to_send()
        for frame in frames:
            if stop.is_set():
                return
            device = devices[frame.bus]
            sent = partial(device.try_send, frame.frame_id, frame.payload, frame.is_extended, frame.is_fd)
            _serve_until(sent, pump, arrivals, stop)
            pump.serve(0.0)
            while device.receive(0.0) is not None:
                pass
        _serve_until(lambda: arrivals.frames >= len(frames), pump, arrivals, stop)
        if not stop.is_set():
            pump.finish()


def _serve_until(is_done: Callable[[], bool], pump: FramePump, arrivals: Arrivals, stop: Event) -> None:
    """Serve until it is done, or `stop` is set. Raises `RunError` when no frame comes through any more.

    Turns are counted, not time: one in which learning is compiled takes a minute.
    """
    came, idle = arrivals.frames, 0
    while not stop.is_set() and not is_done():
        pump.serve(_TURN)
        idle = idle + 1 if arrivals.frames == came else 0
        came = arrivals.frames
        if idle == _MOST_IDLE:
            raise RunError(
                f"the start: of the frames that it sends to itself {came} came through, then none for "
                f"{_MOST_IDLE * _TURN:.0f} s\n  remedy: see what `observer-rt check` says of the bench file; "
                "report it with that file if it says nothing"
            )
