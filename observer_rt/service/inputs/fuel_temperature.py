"""The fuel's temperature, and the model that goes with it."""

import math
from collections.abc import Callable

from observer_rt.model.fuel import is_plausible
from observer_rt.observer.stream.state import Constants, Reason
from observer_rt.service.compiled.by_reference import CompiledPipeline
from observer_rt.service.inputs.held_value import HeldValue
from observer_rt.service.inputs.optional_input import OptionalInput

STEP = 0.1  # K, below which the model stays: .04 % of the bulk modulus, less than injections differ by
PERIOD = 0.1  # s between two changes of the model


class FuelFollower(OptionalInput[float]):
    """Keeps the fuel in force near the measured temperature, and nothing valid while that is not known."""

    def __init__(
        self,
        assumed: float | None,
        compiled: CompiledPipeline,
        constants_at: Callable[[float], Constants],
        timeout: float,
    ) -> None:
        """assumed: temperature [K] that counts until one is measured. timeout [s]."""
        self.temperature = assumed
        """Of the fuel in force [K]."""
        self._compiled = compiled
        self._constants_at = constants_at
        self._measured = HeldValue(timeout)
        self._last_change = -math.inf
        self._change_at = math.inf
        self._waits_for_rest = False
        self._is_assumed = assumed is not None

    def take(self, reading: float, now: float) -> None:
        """A frame came with a temperature [K]; what fuel cannot have counts as not available."""
        if is_plausible(reading):
            self._measured.take(reading, now)
            self._is_assumed = False
        else:
            self._measured.miss(now)

    def heed(self, now: float) -> None:
        """Bring the fuel in force near the measured one, unless within an event; doubt all while it is not known."""
        memory = self._compiled.observer.memory[0]
        measured = self._measured.at(now)
        is_far = self.temperature is None or abs(measured - self.temperature) >= STEP
        is_wanted = is_far and not math.isnan(measured)
        is_too_soon = 0.0 <= now - self._last_change < PERIOD
        self._change_at = self._last_change + PERIOD if is_wanted and is_too_soon else math.inf
        self._waits_for_rest = bool(is_wanted and not is_too_soon and memory["in_event"])
        if is_wanted and not is_too_soon and not memory["in_event"]:
            self._compiled.change_constants(self._constants_at(measured))
            self.temperature = measured
            self._last_change = now
        is_measured = not math.isnan(measured) and self.temperature is not None
        memory["doubted"] = Reason.NONE if self._is_assumed or is_measured else Reason.INPUT_STALE

    def heeded_by(self, now: float) -> float:
        return min(self._change_at, self._measured.counts_until(now))

    @property
    def waits_for_rest(self) -> bool:
        return self._waits_for_rest
