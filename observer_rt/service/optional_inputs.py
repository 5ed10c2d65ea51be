"""What the service makes of the optional inputs."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping import BusMap
from observer_rt.bus.slow_inputs import SlowReceiver
from observer_rt.bus.timekeeping import Timekeeping
from observer_rt.config import OptionalRole
from observer_rt.observer.observer import closed_injections
from observer_rt.observer.state import Observer
from observer_rt.service.energizing import CommandedOpening, EnergizingFigures, EnergizingWatch, Mismatch
from observer_rt.service.measured_mass import MassComparison, MeasuredMass
from observer_rt.service.report import InjectionReport


class OptionalInputs:
    """Receives the optional inputs of a bench; without any it changes nothing.

    A learning enable of 0 holds learning up; another value, "not available" and none so far leave it as configured.
    A measured mass is compared with the estimate, and never learned from. Energizing is compared with the openings.
    """

    def __init__(
        self,
        bus: BusMap,
        learning: bool,
        keeping: Timekeeping,
        observer: Observer,
        on_measured: Callable[[MeasuredMass], None] | None,
        on_mismatch: Callable[[Mismatch], None] | None,
    ) -> None:
        """learning: as configured; on_measured: called with every injection whose mass was measured; on_mismatch:
        with every one that is missing after a command, or has none."""
        self._receiver = SlowReceiver(bus.slow)
        self._observer = observer
        self._configured = learning
        self._is_held = False
        self._masses = MassComparison(on_measured)
        self._watch = None
        if bus.energizing is not None:
            self._watch = EnergizingWatch(bus.energizing, keeping, observer, on_mismatch)

    def take(self, key: int, payload: NDArray[np.uint8], stamp: int) -> bool:
        """Take a frame received at `stamp` [ns], `key` as by `mapping.frame_key`; whether it can have held ours."""
        if not self._receiver.is_ours(key):
            return False
        for role, value in self._receiver.values(key, payload):
            if role is OptionalRole.LEARNING_ENABLE:
                self._is_held = value == 0.0
            else:
                self._masses.on_value(value, closed_injections(self._observer))
        if self._watch is not None:
            self._watch.take(key, payload, stamp)
        return True

    def opening_of(self, injection: np.void) -> CommandedOpening | None:
        """What commanded an injection (`observer.state.INJECTION`) that is about to be reported; None: not known."""
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
