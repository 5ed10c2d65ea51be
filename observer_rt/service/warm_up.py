"""Compile, or load from the cache, everything the loop calls, before the first frame needs it."""

import numpy as np

from observer_rt.bus.database.e2e import protect
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.estimation.predictor import Window
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.recording.replay.framing import Framer, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.core import Core
from observer_rt.service.core.learners import make_learner

_SAMPLES = 100


def warm_up(bench: Bench, bus: BusMap) -> None:
    """Run a few samples at rest through a core of its own, and one training."""
    time = np.arange(_SAMPLES) / bench.injector.config.sampling.rate_hz
    pressure = np.full(_SAMPLES, 50e6)
    recording = Recording(time, pressure, np.zeros(_SAMPLES), pressure)
    core = Core(bench.injector, bus)
    for frame in Framer(bus).frames(recording, whole(recording)):
        core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)
    for layout, frame in ((slow.layout, slow.frame[0]) for slow in bus.slow):
        payload = np.zeros(layout.length, np.uint8)
        protect(payload, layout.length, int(frame["e2e_profile"]), int(frame["data_id"]), 0)
        core.handle(layout.frame_id, layout.is_extended, payload.tobytes(), 0, layout.bus)
    core.finish()
    constants = bench_constants(bench.injector)
    scale = constants.coefficients.pressure_scale
    knowledge = no_knowledge(configured_noise(bench.injector), scale)
    learner = make_learner(bench.injector, constants, knowledge)
    start = np.zeros(constants.coefficients.states + 1)
    window = Window(
        np.full((_SAMPLES, 2), 0.5), np.full(_SAMPLES, 0.5), np.zeros(_SAMPLES, np.bool_), start, 1
    )
    learner.learn(window, Standstill(0, 0.0, None), knowledge.in_force)
