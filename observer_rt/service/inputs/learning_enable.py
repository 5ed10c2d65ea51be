"""The switch of the learning."""

from observer_rt.service.inputs.held_value import HeldValue
from observer_rt.service.inputs.optional_input import OptionalInput


class LearningEnable(OptionalInput[float]):
    """0 holds learning up; another value, "not available", one that is too old and none so far do not."""

    def __init__(self, timeout: float) -> None:
        """timeout: after which a value counts no longer [s]."""
        self.is_held = False
        """Whether learning is held up."""
        self._value = HeldValue(timeout)

    def take(self, reading: float, now: float) -> None:
        """Take a received value."""
        self._value.take(reading, now)

    def heed(self, now: float) -> None:
        """Whether the value says 0 now."""
        self.is_held = self._value.at(now) == 0.0

    def heeded_by(self, now: float) -> float:
        return self._value.counts_until(now)
