"""A slow value that counts until it is too old."""

import math

GRACE = 1.0  # s a value still counts after its sender said that it has none


class HeldValue:
    """The newest value of a slow input; time is that of the samples [s], which may begin anew."""

    def __init__(self, timeout: float) -> None:
        """timeout: after which a value counts no longer [s], inf: never."""
        self._timeout = timeout
        self._value = math.nan
        self._left = 0.0  # s for which it counts
        self._now = 0.0

    def take(self, value: float, now: float) -> None:
        """A value came."""
        self._value, self._left, self._now = value, self._timeout, now

    def miss(self, now: float) -> None:
        """A frame came that has none."""
        self.at(now)
        self._left = min(self._left, GRACE)

    def counts_until(self, now: float) -> float:
        """When the value counts no longer, inf: it does for ever, or does not any more."""
        left = self._left - max(now - self._now, 0.0)
        return now + left if left > 0.0 else math.inf

    def at(self, now: float) -> float:
        """The value that counts, nan: none does. Call it now and then, so that a new beginning of time is seen."""
        self._left -= max(now - self._now, 0.0)
        self._now = now
        return self._value if self._left > 0.0 else math.nan
