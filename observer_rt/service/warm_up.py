"""Compiles, or loads from the cache, all that loop and learning call, before the first frame needs it.

Injections of the bench's own model are led through the daemon. What learning calls a process of its own compiles
meanwhile: the two have little in common, and each finds in the cache what the other left there. Should that fail, the
caller compiles all by itself.
"""

import math
import os
import pickle
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import chain
from pathlib import Path
from threading import Event

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.core.frames.frames import protect_frame
from observer_rt.estimation.predictor import NO_RATE, NO_SLOPES, Setting, Window, follow
from observer_rt.estimation.scalars import nothing_learned
from observer_rt.foundation.compilation import collect_seldom, is_complete, note_complete
from observer_rt.foundation.errors import RunError
from observer_rt.model.hydraulics import normalised_area
from observer_rt.model.line.interface import rest_line
from observer_rt.observer.learning.knowledge import OverheardLearner, no_knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants
from observer_rt.recording.replay.framing import Framer, TimedFrame, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.core import Core
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.pump.pump import FramePump
from observer_rt.service.watch.arrivals import Arrivals
from observer_rt.simulation import schedule
from observer_rt.simulation.schedule import lift_of_stroke, strokes

INJECTIONS = 3  # from the first two is learned, by that the third is judged
BEFORE = 1500  # samples of rest before each: enough for a first guess of the offset
_RAIL_PRESSURE = 60e6  # Pa
_ENERGIZING = 1e-3  # s
_AFTER = 10e-3  # s, in which needle and line come to rest


def own_injections(fitted: BenchInjector) -> Recording:
    """Injections of the model as given, with the noise the bench states."""
    rate = fitted.config.sampling.rate_hz
    period = BEFORE / rate + _ENERGIZING + _AFTER
    shots = (schedule.Shot(_ENERGIZING),)
    events = tuple(
        schedule.Event(BEFORE / rate + i * period, _RAIL_PRESSURE, shots) for i in range(INJECTIONS)
    )
    found = strokes(schedule.Schedule(events, INJECTIONS * period), fitted.parameters)
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
    gain = np.zeros(c.states)
    setting = Setting(constants.interval, constants.substeps, c, gain, program=constants.program)
    follow(window, setting, nothing_learned(c), window.opening, errors, NO_RATE, None, NO_SLOPES)
    return c.chamber_pressure - errors * c.pressure_scale


_PACKAGE_FOLDER = Path(__file__).parents[2]
_LEAD = 500  # samples of a window before its opening
_OPEN = 5e-6  # m
_LOOK = 0.05  # s between two looks whether the other process has ended


@contextmanager
def learning_compiled_beside(
    fitted: BenchInjector, stop: Event | None = None
) -> Iterator[Callable[[], object]]:
    """Have another process compile what an injector's learning calls; to be called: waits until it has.

    It waits no longer once `stop` is set. Nothing is done where that was compiled before.
    """
    work, stop = _work(fitted), stop or Event()
    if is_complete(work):
        yield lambda: 0
        return
    paths = (str(_PACKAGE_FOLDER), os.environ.get("PYTHONPATH", ""))
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import serve; serve()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
        start_new_session=True,  # what is typed at the caller's terminal is for the caller
    )
    try:
        assert process.stdin is not None
        with suppress(BrokenPipeError), process.stdin as pipe:
            pickle.dump(fitted, pipe)

        def wait() -> int | None:
            """Its exit code; None: it goes on."""
            while process.poll() is None and not stop.wait(_LOOK):
                pass
            if process.returncode == 0:
                note_complete(work)
            return process.returncode

        yield wait
    finally:
        process.kill()
        process.wait()


def _work(fitted: BenchInjector) -> str:
    """What the types of compiled code depend on."""
    sampling = fitted.config.sampling
    return f"learning-{fitted.parameters.line.model}-{sampling.meaning}"


def awaited(learner_of: LearnerFactory, wait: Callable[[], object]) -> LearnerFactory:
    """Learners that wait before their first event."""
    return lambda *of: OverheardLearner(learner_of(*of), lambda *_: wait())


def serve() -> None:
    """The other process: learn from injections of the injector on its standard input."""
    collect_seldom()
    fitted: BenchInjector = pickle.load(sys.stdin.buffer)
    recording = own_injections(fitted)
    constants, noise = bench_constants(fitted), configured_noise(fitted)
    knowledge = no_knowledge(noise, constants.coefficients.pressure_scale)
    learner = make_learner(fitted, constants, knowledge)
    for number in range(INJECTIONS):
        window = _window(recording, constants, number)
        learner.learn(window, Standstill(BEFORE, 0.0, noise), knowledge.in_force)


def _window(recording: Recording, constants: Constants, number: int) -> Window:
    """As an observer would copy it from its ring."""
    c = constants.coefficients
    shot = recording.time.size // INJECTIONS
    opening = number * shot + int(np.argmax(recording.needle_lift[number * shot :] > _OPEN))
    rows = slice(opening - _LEAD, min(opening + BEFORE, recording.time.size))
    lift = np.where(recording.needle_lift[rows] > _OPEN, recording.needle_lift[rows], 0.0)
    area = np.array([normalised_area(each, c.seat) for each in lift])
    rail, line = (
        (pressure[rows] - c.chamber_pressure) / c.pressure_scale
        for pressure in (recording.rail_pressure, recording.line_pressure)
    )
    start = np.full(c.states + 1, line[0])
    rest_line(start[:-1], line[0], c.line)
    return Window(
        inputs=np.column_stack([rail, area]),
        output=np.column_stack([line, line])[:, 0],  # not contiguous, as a field of rows
        resting=area <= 0.0,
        start=start,
        opening=_LEAD,
        knots=np.zeros((area.size, 2)),
        masked=np.zeros(area.size, np.bool_),
    )


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
        protect_frame(payload, layout.length, layout.protection, 0)
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
