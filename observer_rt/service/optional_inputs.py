"""What the service makes of the optional inputs."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.slow_inputs import SlowMessage, SlowReceiver
from observer_rt.config import OptionalRole
from observer_rt.observer.observer import closed_injections
from observer_rt.observer.state import Observer
from observer_rt.service.measured_mass import MassComparison, MeasuredMass
from observer_rt.service.report import InjectionReport


class OptionalInputs:
    """Receives the optional inputs of a bench; without any it changes nothing.

    A learning enable of 0 holds learning up; another value, "not available" and none so far leave it as configured.
    A measured mass is compared with the estimate, and never learned from.
    """

    def __init__(
        self,
        messages: Sequence[SlowMessage],
        learning: bool,
        on_measured: Callable[[MeasuredMass], None] | None,
    ) -> None:
        """learning: as configured; on_measured: called with every injection whose mass was measured."""
        self._receiver = SlowReceiver(messages)
        self._configured = learning
        self._is_held = False
        self._masses = MassComparison(on_measured)

    def take(self, key: int, payload: NDArray[np.uint8], observer: Observer) -> bool:
        """Take a received frame, `key` as by `mapping.frame_key`; whether it can have held anything of ours."""
        if not self._receiver.is_ours(key):
            return False
        for role, value in self._receiver.values(key, payload):
            if role is OptionalRole.LEARNING_ENABLE:
                self._is_held = value == 0.0
            else:
                self._masses.on_value(value, closed_injections(observer))
        return True

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
