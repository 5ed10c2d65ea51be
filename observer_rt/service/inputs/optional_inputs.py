"""What the service makes of the optional inputs."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.slow_inputs import SlowReceiver
from observer_rt.config.signals import OptionalRole
from observer_rt.observer.observer import closed_injections
from observer_rt.observer.stream.state import Constants
from observer_rt.service.core.compiled import CompiledPipeline
from observer_rt.service.core.injection_report import InjectionReport
from observer_rt.service.inputs.energizing import (
    CommandedOpening,
    EnergizingFigures,
    EnergizingWatch,
    Mismatch,
)
from observer_rt.service.inputs.fuel import Fuel, FuelFollower
from observer_rt.service.inputs.held_value import HeldValue
from observer_rt.service.inputs.measured_mass import MassComparison, MeasuredMass


class OptionalInputs:
    """Receives the optional inputs of a bench; without any it changes nothing.

    A learning enable of 0 holds learning up; another value, "not available", one that is too old and none so far
    leave it as configured. A measured mass is compared with the estimate, and never learned from. Energizing is
    compared with the openings. The fuel's temperature makes the model that of fuel so warm. Time is that of the
    samples [s].
    """

    def __init__(
        self,
        bus: BusMap,
        learning: bool,
        compiled: CompiledPipeline,
        on_measured: Callable[[MeasuredMass], None] | None,
        on_mismatch: Callable[[Mismatch], None] | None,
        fuel: Fuel,
        constants_at: Callable[[float], Constants],
    ) -> None:
        """learning: as configured; on_measured: called with every injection whose mass was measured; on_mismatch:
        with every one that is missing after a command, or has none.

        fuel: at the start; constants_at: the observer's constants with fuel at a temperature [K].
        """
        timeouts = {signal.role: signal.timeout for message in bus.slow for signal in message.signals}
        self._receiver = SlowReceiver(bus.slow)
        self._compiled = compiled
        self._configured = learning
        self._enable = HeldValue(timeouts.get(OptionalRole.LEARNING_ENABLE, math.inf))
        self._is_held = False
        self._masses = MassComparison(on_measured)
        self.fuel: FuelFollower | None = None
        """Where its temperature is measured."""
        if OptionalRole.FUEL_TEMPERATURE in timeouts:
            self.fuel = FuelFollower(fuel, constants_at, timeouts[OptionalRole.FUEL_TEMPERATURE])
        self._watch = None
        if bus.energizing is not None:
            self._watch = EnergizingWatch(bus.energizing, compiled, on_mismatch)

    def take(self, key: int, payload: NDArray[np.uint8], stamp: int, now: float) -> None:
        """Take a frame of any message, received at `stamp` [ns]; `key` as by `frame_key`."""
        if self._receiver.is_ours(key):
            for role, value in self._receiver.values(key, payload):
                self._take_value(role, value, now)
            if self._watch is not None:
                self._watch.take(key, payload, stamp)
        self._is_held = self._enable.at(now) == 0.0

    def _take_value(self, role: OptionalRole, value: float, now: float) -> None:
        if role is OptionalRole.LEARNING_ENABLE:
            self._enable.take(value, now)
        elif role is OptionalRole.MEASURED_MASS:
            self._masses.on_value(value, closed_injections(self._compiled.observer))
        elif self.fuel is not None:
            self.fuel.take(value, now)

    def opening_of(self, injection: np.void) -> CommandedOpening | None:
        """What commanded an injection (`stream.state.INJECTION`) that is about to be reported; None: not known."""
        return None if self._watch is None else self._watch.opening_of(injection)

    def look(self) -> None:
        """Samples were processed."""
        if self._watch is not None:
            self._watch.look()

    @property
    def energizing(self) -> EnergizingFigures | None:
        """What was found of commands and openings; None for a bench without energizing."""
        return None if self._watch is None else self._watch.figures

    def on_report(self, report: InjectionReport) -> None:
        """Take an injection that was just reported."""
        self._masses.on_report(report)

    @property
    def learning(self) -> bool:
        """Whether an event that closes now is learned from."""
        return self._configured and not self._is_held

    @property
    def crc_errors(self) -> int:
        """Damaged frames of messages that carry nothing but optional inputs."""
        return self._receiver.crc_errors

    @property
    def length_errors(self) -> int:
        """Frames of such messages with a wrong length."""
        return self._receiver.length_errors
