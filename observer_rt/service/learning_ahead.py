"""What learning calls, compiled in a process of its own while the caller compiles the loop.

The two have little in common; the caller then finds in the cache what the other left there. Should that fail, it
compiles all by itself.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event

import numpy as np

from observer_rt.config.bench import BenchInjector
from observer_rt.estimation.predictor import Window
from observer_rt.foundation.compilation import collect_seldom, is_complete, note_complete
from observer_rt.model.line.interface import rest_line
from observer_rt.model.seat import normalised_area
from observer_rt.observer.learning.knowledge import OverheardLearner, no_knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.own_injections import BEFORE, INJECTIONS, own_injections

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
