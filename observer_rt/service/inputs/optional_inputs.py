"""The optional inputs of a bench: their frames received, each handed to what the service makes of it."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.energizing import EnergizingReceiver
from observer_rt.bus.mapping.slow_inputs import SlowReceiver
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import OptionalRole
from observer_rt.observer.stream.state import RING
from observer_rt.service.compiled.by_reference import CompiledPipeline
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.inputs.energizing import EnergizingFigures, EnergizingWatch
from observer_rt.service.inputs.fuel_temperature import FuelFollower
from observer_rt.service.inputs.learning_enable import LearningEnable
from observer_rt.service.inputs.measured_mass import MassComparison
from observer_rt.service.inputs.optional_input import OptionalInput
from observer_rt.service.reports.injection_report import CommandedOpening, InjectionReport
from observer_rt.service.reports.news import Listener

_NEVER = 1 << 62  # no index


@dataclass(frozen=True)
class Again:
    """When to heed the inputs again: from the index `due` on, when the index begins anew below `now`, `at_rest`."""

    now: int
    due: int
    at_rest: bool


class OptionalInputs:
    """Receives the optional inputs of a bench; without any it changes nothing.

    A learning enable of 0 holds learning up. A measured mass is compared with the estimate, and never learned from.
    Energizing is compared with the openings. The fuel's temperature makes the model that of fuel so warm.
    """

    def __init__(
        self,
        fitted: BenchInjector,
        bus: BusMap,
        compiled: CompiledPipeline,
        tell: Listener,
        fuel_temperature: float | None,
        is_restored: bool,
    ) -> None:
        """tell: of measured masses and mismatches; fuel_temperature [K]: until it is measured."""
        timeouts = {signal.role: signal.timeout for message in bus.slow for signal in message.signals}
        self._bus = bus
        self._receiver = SlowReceiver(bus.slow)
        self._compiled = compiled
        self._first_index: int | None = None
        self._enable = LearningEnable(timeouts.get(OptionalRole.LEARNING_ENABLE, math.inf))
        self._masses = MassComparison(tell, compiled)
        self._by_role: dict[OptionalRole, OptionalInput[float]] = {
            OptionalRole.LEARNING_ENABLE: self._enable,
            OptionalRole.MEASURED_MASS: self._masses,
        }
        self._all: list[OptionalInput[float] | EnergizingWatch] = [self._enable]
        self._fuel: FuelFollower | None = None
        if OptionalRole.FUEL_TEMPERATURE in timeouts:
            constants_at = partial(bench_constants, fitted, is_restored)
            timeout = timeouts[OptionalRole.FUEL_TEMPERATURE]
            self._fuel = FuelFollower(fuel_temperature, compiled, constants_at, timeout)
            self._by_role[OptionalRole.FUEL_TEMPERATURE] = self._fuel
            self._all.append(self._fuel)
        self._watch: EnergizingWatch | None = None
        if bus.energizing is not None:
            self._pulses = EnergizingReceiver(bus.energizing)
            self._watch = EnergizingWatch(bus.energizing, compiled, tell)
            self._all.append(self._watch)

    def take(self, key: int, payload: NDArray[np.uint8], stamp: int) -> None:
        """Take a frame of any message, received at `stamp` [ns]; `key` as by `frame_key`.

        What it brings, or that its message stays away, takes effect before its samples are observed.
        """
        if not self._bus.slow:
            return
        now = self._time_of_samples()
        if self._receiver.is_ours(key):
            for role, value in self._receiver.values(key, payload):
                self._by_role[role].take(value, now)
            if self._watch is not None and self._pulses.is_ours(key):
                reading = self._pulses.read(payload, stamp)
                if reading is not None:
                    self._watch.take(reading, now)
        for one in self._all:
            one.heed(now)

    def again(self) -> Again:
        """When to call `take` again, if no frame brings an input before."""
        at_rest = any(one.waits_for_rest for one in self._all)
        newest, now = self._newest_index(), self._time_of_samples()
        if newest is None:  # with the first samples their time begins
            return Again(0, -_NEVER, at_rest)
        interval = self._compiled.observer.constants.interval
        left = min(one.heeded_by(now) for one in self._all) - now
        index = _NEVER if left == math.inf else newest + math.ceil(left / interval)
        return Again(newest, index, at_rest)

    @property
    def looks_at_each(self) -> bool:
        """Whether `look` is to be called after every frame: else only now and then."""
        return any(one.looks_at_each for one in self._all)

    def look(self) -> None:
        """Samples were observed."""
        for one in self._all:
            one.look()

    def opening_of(self, injection: np.void) -> CommandedOpening | None:
        """What commanded an injection (`stream.state.INJECTION`) that is about to be reported; None: not known."""
        return None if self._watch is None else self._watch.opening_of(injection)

    def on_injection(self, report: InjectionReport) -> None:
        """Take an injection that was just reported."""
        self._masses.on_injection(report)

    @property
    def holds_learning(self) -> bool:
        """Whether an event that closes now is not to be learned from."""
        return self._enable.is_held

    @property
    def fuel_temperature(self) -> float | None:
        """Of the fuel in force [K]; None where it is not measured."""
        return None if self._fuel is None else self._fuel.temperature

    @property
    def energizing(self) -> EnergizingFigures | None:
        """What was found of commands and openings; None for a bench without energizing."""
        return None if self._watch is None else self._watch.figures

    @property
    def crc_errors(self) -> int:
        """Damaged frames of messages that carry nothing but optional inputs."""
        return self._receiver.crc_errors

    @property
    def length_errors(self) -> int:
        """Frames of such messages with a wrong length."""
        return self._receiver.length_errors

    def _time_of_samples(self) -> float:
        """Of the newest received sample, since the first [s]; the index of a device may begin with any number."""
        index = self._newest_index()
        if index is None:
            return 0.0
        if self._first_index is None:
            self._first_index = index
        return (index - self._first_index) * self._compiled.observer.constants.interval

    def _newest_index(self) -> int | None:
        observer = self._compiled.observer
        received = int(observer.memory["received"][0])
        return int(observer.ring[(received - 1) % RING]["index"]) if received else None
