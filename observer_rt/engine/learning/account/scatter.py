"""Scatter of events about what was believed: where they differ by more than it says, it is too sure of itself."""

from dataclasses import dataclass

from observer_rt.engine.learning.account import constants as c


@dataclass(frozen=True)
class Scatter:
    """Running mean of the scores of events that came as believed, over the usual one."""

    events: float = c.SCATTER_PRIOR
    ratios: float = c.SCATTER_PRIOR

    @property
    def factor(self) -> float:
        """Factor on the variances of theta, 1 at least."""
        return max(1.0, self.ratios / self.events)

    def after(self, score: float) -> "Scatter":
        """Adds the score of an event before it was fitted."""
        return Scatter(
            c.SCATTER_KEPT * self.events + 1.0, c.SCATTER_KEPT * self.ratios + min(score, c.LARGEST_SCORE)
        )
