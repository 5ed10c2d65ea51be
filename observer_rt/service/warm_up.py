"""Compile, or load from the cache, everything the loop and the training call, before the first frame needs it."""

import math
import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.e2e import protect
from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.estimation.learned import nothing_learned
from observer_rt.estimation.predictor import NO_RATE, NO_SLOPES, Setting, Window, follow
from observer_rt.model.line.interface import rest_line
from observer_rt.model.seat import normalised_area
from observer_rt.recording.replay.framing import Framer, TimedFrame, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.core import Core
from observer_rt.service.pump.compiled_pump import CompiledPump, is_pumped
from observer_rt.service.watch.arrivals import Arrivals
from observer_rt.simulation.needle import lift_of_stroke, strokes
from observer_rt.simulation.schedule import Event, Schedule, Shot

INJECTIONS = 3  # from the first two is learned, by that the third is judged
_RAIL_PRESSURE = 60e6  # Pa
_ENERGIZING = 1e-3  # s
_REST = 1500  # samples before an injection: enough for a first guess of the offset
_AFTER = 10e-3  # s, in which needle and line come to rest
_ROOM = 1e-3  # s to wait for room in a socket


def warm_up(bench: Bench, bus: BusMap) -> Core:
    """Take the bench's model through a few injections of its own, frames, training and results included.

    Code that is only compiled is still to be loaded, linked and its branches still to be met: a first real event
    after that took ten times as long as the next. Returns the core that was used up.
    """
    recording = _injections(bench.injector)
    core = Core(bench.injector, bus)
    frames = [*Framer(bus).frames(recording, whole(recording)), *_slow_frames(bus)]
    if is_pumped(bench, bus):
        _pump(core, bus, frames, len(bench.config.buses))
        return core
    for frame in frames:
        core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)
    core.finish()
    return core


def _slow_frames(bus: BusMap) -> Iterator[TimedFrame]:
    """One of every message with optional inputs."""
    for layout, frame in ((slow.layout, slow.frame[0]) for slow in bus.slow):
        payload = np.zeros(layout.length, np.uint8)
        protect(payload, layout.length, int(frame["e2e_profile"]), int(frame["data_id"]), 0)
        identifier, is_extended = layout.frame_id, layout.is_extended
        yield TimedFrame(0.0, identifier, is_extended, layout.is_fd, payload.tobytes(), bus=layout.bus)


def _pump(core: Core, bus: BusMap, frames: Sequence[TimedFrame], buses: int) -> None:
    """The frames through sockets and the compiled loop."""
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
        pump = CompiledPump(links, core, bus, arrivals)
        stack.callback(pump.close)
        for frame in frames:
            device = devices[frame.bus]
            while not device.try_send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd):
                pump.serve(_ROOM)
            pump.serve(0.0)
            while device.receive(0.0) is not None:
                pass
        while arrivals.frames < len(frames):
            pump.serve(_ROOM)
        pump.finish()


def _injections(fitted: BenchInjector) -> Recording:
    """Injections of the model as given, with the noise the bench states."""
    rate = fitted.config.sampling.rate_hz
    period = _REST / rate + _ENERGIZING + _AFTER
    shots = (Shot(_ENERGIZING),)
    events = tuple(Event(_REST / rate + i * period, _RAIL_PRESSURE, shots) for i in range(INJECTIONS))
    found = strokes(Schedule(events, INJECTIONS * period), fitted.parameters)
    time = np.arange(math.ceil((INJECTIONS * period + _AFTER) * rate)) / rate
    lift = np.array([sum(lift_of_stroke(instant, each) for each in found) for instant in time])
    random, noise = np.random.default_rng(0), configured_noise(fitted)

    def measured(values: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
        return values + random.normal(0.0, sigma, time.size)

    return Recording(
        time,
        measured(np.full(time.size, _RAIL_PRESSURE), noise.rail_pressure),
        measured(lift, noise.needle_lift),
        measured(_line_pressure(fitted, lift), noise.line_pressure),
    )


def _line_pressure(fitted: BenchInjector, lift: NDArray[np.float64]) -> NDArray[np.float64]:
    """What a lift [m], (n,), makes of the line pressure [Pa] by the model as given."""
    constants = bench_constants(fitted)
    c = constants.coefficients
    rail = (_RAIL_PRESSURE - c.chamber_pressure) / c.pressure_scale
    start = np.full(c.states + 1, rail)
    rest_line(start[:-1], rail, c.line)
    window = Window(
        inputs=np.column_stack([np.full(lift.size, rail), [normalised_area(each, c.seat) for each in lift]]),
        output=np.zeros(lift.size),
        resting=lift <= 0.0,
        start=start,
        opening=1,
    )
    errors = np.empty(lift.size)  # of an output of 0
    setting = Setting(constants.interval, constants.substeps, c, np.zeros(c.states))
    follow(window, setting, nothing_learned(c), window.opening, errors, NO_RATE, None, NO_SLOPES)
    return c.chamber_pressure - errors * c.pressure_scale
