"""The moments at which a needle leaves and meets its seat, when samples do not show what it does between them."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import Measurement

AFTER_OPENING = 0.08e-3  # s
BESIDE_CLOSING = 0.05e-3  # s


def away_from(measurement: Measurement, openings: bool, closings: bool) -> NDArray[np.bool_]:
    """Which judged innovations (n,) of a recording lie away from openings, from closings, or from both.

    Neither how a needle gathers speed between two samples nor the kink that follows, in cells of a line, is modelled.
    What an opening leaves would be laid to seat and stiffness: -.4 % of mass.
    """
    rate = measurement.recording.sample_rate
    after, beside = round(AFTER_OPENING * rate), round(BESIDE_CLOSING * rate)
    result = []
    for event in measurement.events:
        samples = np.arange(event.counted, event.end)
        away = np.ones(samples.size, np.bool_)
        for opening in event.openings:
            if openings:
                away &= (samples < opening.first - 1) | (samples >= opening.first + after)
            if closings:
                away &= (samples < opening.last - beside) | (samples >= opening.last + beside)
        result.append(away)
    return np.concatenate(result)
