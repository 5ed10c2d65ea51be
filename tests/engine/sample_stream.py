"""Drives the observer sample by sample, as the service does, and keeps every processed sample."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.core.stream.stream import INJECTIONS, RECORDED, RECORDED_RING, RING, Break
from observer_rt.desk.simulation.plant import Truth, run_plant
from observer_rt.desk.simulation.schedule import make_schedule, strokes
from observer_rt.engine import observer as engine_observer
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.knowledge import Outcome, no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.mailbox import post_examined, post_learned
from observer_rt.engine.stream.standstill import RestingLift, Standstill, standstill_of
from observer_rt.engine.stream.state import LIFT, Observer, sample_dtype
from observer_rt.engine.stream.state import RAIL as RAIL_CHANNEL
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from tests.plants.arrays import Array

NOISE = NoiseLevels(rail_pressure=0.1e6, line_pressure=0.15e6, needle_lift=0.4e-6)
NOMINAL = load_injector()
RAIL = 100e6  # Pa
FINE = 500e3  # Hz, of a true course
PIECE = 1000  # samples fed between two looks
Channels = tuple[Array, Array, Array]
"""Rail pressure, lift and line pressure [Pa, m, Pa]."""


def _push_all(
    observer: Observer, index: int, rail: Array, lift: Array, line: Array, broken: int, between: tuple[float, float]
) -> None:
    """Samples from an index on into the ring of recorded ones, and taken in; between: shares of lift and rail."""
    recorded = int(observer.memory[0]["positions"]["recorded"])
    places = np.arange(recorded, recorded + rail.size) % RECORDED_RING
    rows = np.zeros(rail.size, RECORDED)
    rows["index"] = index + np.arange(rail.size)
    rows["values"] = np.stack([rail, lift, line], axis=1)
    rows["shares"][:, LIFT], rows["shares"][:, RAIL_CHANNEL] = between
    if rail.size:
        rows["broken"][0] = broken
    observer.recorded[places] = rows
    observer.stream.take(recorded + rail.size, 0)


def judge(observer: Observer, objections: Sequence[Objection], outcome: Outcome | None) -> None:
    number = int(observer.memory[0]["judgement"]["events_taken"])
    if outcome is None:
        post_examined(observer, number, objections)
    else:
        post_learned(observer, number, outcome)
    observer.stream.judged()


@dataclass
class Stream:
    """`rows`: processed samples; `judged`: indices before which an event was judged; stated: delays to be undone."""

    injector: InjectorParameters = NOMINAL
    sample_rate: float = 100e3
    durations: engine_observer.Durations = field(default_factory=engine_observer.Durations)
    events_required: int = 2
    learning: bool = False
    keep: bool = True
    stated: tuple[SizedEffect, ...] = ()
    lift: RestingLift = field(default_factory=RestingLift)
    judged: list[int] = field(default_factory=list)
    outcomes: list[Outcome | None] = field(default_factory=list)

    def __post_init__(self) -> None:
        constants = engine_observer.constants_for(
            self.injector, self.sample_rate, self.durations, self.events_required, stated=self.stated
        )
        knowledge = replace(no_knowledge(NOISE, constants.coefficients.pressure_scale), lift=self.lift)
        self.learner = Learner(constants, knowledge)
        self.observer: Observer = engine_observer.make_observer(constants, knowledge, self.learner)
        if not self.learning:  # the pressures are made up: nothing shall contradict them
            self.observer.memory["innovation_noise"]["weight"] = 0.0
        self._kept: list[NDArray[np.void]] = []
        self._seen = 0
        self._next_index = 0
        self._begun = False

    def feed(
        self,
        rail: Array,
        lift: Array,
        line: Array,
        index: int | None = None,
        broken: Break = Break.NONE,
        lift_after: float = 0.0,
        rail_share: float = 0.0,
    ) -> "Stream":
        """Samples [Pa, m, Pa] from `index` on (default: where the last ones ended).

        lift_after: share of an interval by which the lift is later; rail_share: of the rail's later neighbour.
        """
        first = self._next_index if index is None else index
        if not self._begun:
            broken, self._begun = Break.START, True
        for k in range(0, rail.size, PIECE):
            piece = slice(k, k + PIECE)
            begins = int(broken) if k == 0 else 0
            _push_all(
                self.observer, first + k, rail[piece], lift[piece], line[piece], begins, (lift_after, rail_share)
            )
            self._advance()
        self._next_index = first + rail.size
        return self

    def stay_shut(self, duration: float, **where: int) -> "Stream":
        return self.move(np.zeros(round(duration * self.sample_rate)), **where)

    def move(self, lift: Array, **where: int) -> "Stream":
        """A needle that moves so [m] beside pressures that stand still, without noise."""
        pressure = np.full(lift.size, RAIL)
        return self.feed(pressure, lift, pressure, **where)  # type: ignore[arg-type]

    def finish(self) -> "Stream":
        self.observer.memory["mode"]["draining"] = True
        self._advance()
        return self

    @property
    def rows(self) -> NDArray[np.void]:
        return np.concatenate(self._kept) if self._kept else np.zeros(0, sample_dtype(3))

    @property
    def injections(self) -> NDArray[np.void]:
        begun = int(self.observer.memory[0]["counts"]["injections_begun"])
        assert begun <= INJECTIONS
        records: NDArray[np.void] = self.observer.injections[:begun]
        return records

    def count(self, owner: str, name: str) -> int:
        return int(self.observer.memory[0][owner][name])

    @property
    def standstill(self) -> Standstill:
        return standstill_of(self.observer.memory[0], self.observer.constants.coefficients.pressure_scale)

    def _advance(self) -> None:
        while self.observer.stream.advance():
            self._keep()
            position = self.count("positions", "processed")
            waiting_index = int(self.observer.ring[position % RING]["index"])
            self.judged.append(waiting_index if position < self.count("positions", "received") else -1)
            number = self.count("judgement", "events_taken")
            window = engine_observer.event_window(self.observer, number) if self.learning else None
            outcome = None
            if window is not None:
                carried = self.observer.theta.copy()
                outcome = self.learner.learn(window, engine_observer.event_standstill(self.observer, number), carried)
            self.outcomes.append(outcome)
            judge(self.observer, () if outcome is None else outcome.forward, outcome)
        self._keep()

    def _keep(self) -> None:
        processed = self.count("positions", "processed")
        if self.keep:
            self._kept.append(engine_observer.samples_at(self.observer, self._seen, processed))
        self._seen = processed


def stroke(open_for: int, peak: float = 0.3e-3, ramp: int = 20) -> Array:
    """Lift [m] of one opening: exactly `open_for` samples above 0, straight ramps of `ramp` samples."""
    k = np.arange(1, open_for + 1)
    return peak * np.clip(np.minimum(k, open_for + 1 - k) / ramp, 0.0, 1.0)


def lift_with(length: int, strokes: Mapping[int, Array | int]) -> Array:
    """Lift [m] of `length` samples with strokes at some of them, or usual ones of so many samples."""
    lift = np.zeros(length)
    for start, shape in strokes.items():
        values = stroke(shape) if isinstance(shape, int) else shape
        lift[start : start + values.size] = values[: length - start]
    return lift


def opened(starts: Iterable[int], length: int, open_for: int = 110) -> Array:
    return lift_with(length, dict.fromkeys(starts, open_for))


def at_rest(random: Generator, length: int, levels: NoiseLevels = NOISE) -> Channels:
    sigmas = levels.rail_pressure, levels.needle_lift, levels.line_pressure
    rail, lift, line = (random.normal(0.0, sigma, length) for sigma in sigmas)
    return RAIL + rail, lift, RAIL + line


def assert_levels(noise: NoiseLevels | None, levels: NoiseLevels, share: float) -> None:
    assert noise is not None
    assert noise.rail_pressure == pytest.approx(levels.rail_pressure, rel=share)
    assert noise.line_pressure == pytest.approx(levels.line_pressure, rel=share)
    assert noise.needle_lift == pytest.approx(levels.needle_lift, rel=share)


@cache
def true_course(injections: int, period: float, durations: tuple[float, ...], *effects: SizedEffect) -> Truth:
    """What the nominal injector with effects does at 100 MPa, at 500 kHz; a period [s], energizing [s] in turn."""
    schedule = make_schedule([RAIL], injections, period, durations)
    time = np.arange(round(schedule.duration * FINE)) / FINE
    model = effective_model(NOMINAL, effects)
    return run_plant(model, strokes(schedule, NOMINAL), time, schedule.rail_pressure(time))


def period_means(signal: Array, every: int) -> Array:
    between = 0.5 * (signal[1:] + signal[:-1])
    return np.append(signal[:1], between[: between.size // every * every].reshape(-1, every).mean(axis=1))


def beside_rest(lift: Array, fall: float = 0.0, since: int = 0, innovation_weight: float = 0.0) -> Stream:
    """Results of a lift [m] beside pressures at rest; fall [Pa]: of the line; innovation_weight: 1/sigma^2."""
    random = np.random.default_rng(9)
    rail = RAIL + random.normal(0.0, NOISE.rail_pressure, lift.size)
    line = RAIL + random.normal(0.0, NOISE.line_pressure, lift.size)
    line[since:] -= fall
    stream = Stream(events_required=0)
    stream.observer.memory["innovation_noise"]["weight"] = innovation_weight
    return stream.feed(rail, lift, line)
