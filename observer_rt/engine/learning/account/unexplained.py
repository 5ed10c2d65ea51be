"""Line pressure that a model leaves unexplained, as a share of the mass it would be at the nozzle.

With a hum of the supply the noise takes its colour, and no test hears it any more; the mass does.
"""

from dataclasses import dataclass

import numpy as np

from observer_rt.engine.estimation.predictor import Setting, Window, innovations
from observer_rt.engine.estimation.scalars import Theta, learned_of
from observer_rt.engine.learning.account import constants as c
from observer_rt.engine.learning.disturbances.colour import resting_segments
from observer_rt.engine.learning.disturbances.noise_levels import mask_of

FEWEST = 5  # samples with the needle open


@dataclass(frozen=True)
class UnexplainedPressure:
    """Mean square of the share, over recent events: sum, and of how many stretches."""

    squares: float = 0.0
    count: float = 0.0

    @property
    def variance(self) -> float:
        """Variance of a mass, as a share, by it."""
        return c.UNEXPLAINED_COUNTS * self.squares / self.count if self.count else 0.0

    def after(self, window: Window, setting: Setting, theta: Theta, first: int) -> "UnexplainedPressure":
        """Adds an event explained with theta (m,), from sample `first` on.

        Means of the recorded less the indicated line pressure, with no gain, over the injection and over stretches of
        rest as long: half of it, over the rail pressure, is the share of a flow.
        """
        counts = np.zeros(window.output.size, np.bool_)
        counts[window.opening :] = True
        counts &= (window.inputs[:, 1] > 0.0) & ~mask_of(window)
        length = int(np.count_nonzero(counts))
        if length < FEWEST:
            return self
        left = np.empty(window.output.size)
        setting = setting._replace(gain=np.zeros_like(setting.gain))
        innovations(window, setting, learned_of(theta, setting.coefficients), left)
        if not np.isfinite(left).all():
            return self
        means = [float(left[counts].mean())]
        for segment in resting_segments(window, first, length):
            blocks = left[segment][: (segment.stop - segment.start) // length * length].reshape(-1, length)
            means += blocks.mean(axis=1).tolist()
        shares = np.array(means) / (2.0 * float(window.inputs[window.opening, 0]))
        kept = c.UNEXPLAINED_KEPT
        return UnexplainedPressure(
            kept * self.squares + float(shares @ shares), kept * self.count + shares.size
        )
