"""The fuel's temperature, and the model that goes with it."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from observer_rt.model.fuel import is_plausible
from observer_rt.observer.stream.state import Constants
from observer_rt.service.inputs.held_value import HeldValue

STEP = 0.1  # K, below which the model stays: .04 % of the bulk modulus, less than injections differ by
PERIOD = 0.1  # s between two changes of the model


@dataclass(frozen=True)
class Fuel:
    """Fuel at a temperature [K] (None: as in the injector file), and the observer's constants with it."""

    temperature: float | None
    constants: Constants


class FuelFollower:
    """Keeps the fuel in force near the measured temperature."""

    def __init__(self, fuel: Fuel, constants_at: Callable[[float], Constants], timeout: float) -> None:
        """fuel: at the start; its temperature, if it has one, counts until one is measured. timeout [s]."""
        self.fuel = fuel
        self._constants_at = constants_at
        self._measured = HeldValue(timeout)
        self._last_change = -math.inf
        self._is_assumed = fuel.temperature is not None

    def take(self, temperature: float, now: float) -> None:
        """A frame came with a temperature [K]; what fuel cannot have counts as not available. now [s]."""
        if is_plausible(temperature):
            self._measured.take(temperature, now)
            self._is_assumed = False
        else:
            self._measured.miss(now)

    def is_known(self, now: float) -> bool:
        """Whether the fuel in force is the one measured, or assumed."""
        is_measured = not math.isnan(self._measured.at(now)) and self.fuel.temperature is not None
        return self._is_assumed or is_measured

    def follow(self, now: float) -> bool:
        """Bring the fuel in force near the measured one, where it is far; whether it changed. Not within an event."""
        measured = self._measured.at(now)
        if math.isnan(measured) or 0.0 <= now - self._last_change < PERIOD:
            return False
        if self.fuel.temperature is not None and abs(measured - self.fuel.temperature) < STEP:
            return False
        self.fuel = Fuel(measured, self._constants_at(measured))
        self._last_change = now
        return True
