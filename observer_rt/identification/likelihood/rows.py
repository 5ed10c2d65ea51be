"""Rows: the samples of all events of a recording, one event after another, and which of them are judged."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.likelihood.events import JudgedEvent
from observer_rt.identification.likelihood.measurement import Measurement

RATE_DELAY = 40e-6  # s after an opening from which a measured rate is judged
MASS_LEAD, MASS_TAIL = 0.15e-3, 0.5e-3  # s beside an event's openings that its mass is summed over


def in_mass_window(measurement: Measurement, event: JudgedEvent, samples: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Selects the samples (n,) of a recording over which an event's mass is summed."""
    lead, tail = (round(t / measurement.interval) for t in (MASS_LEAD, MASS_TAIL))
    inside = np.zeros(samples.size, np.bool_)
    for opening in event.openings:
        inside |= (samples >= opening.first - lead) & (samples <= opening.last + tail)
    return inside


class Rows:
    """Rows of a batch that hold the samples of a recording."""

    def __init__(self, measurement: Measurement) -> None:
        events = measurement.events
        self.samples = np.concatenate([np.arange(e.start, e.end) for e in events])
        """(n,): the sample whose line pressure a row holds."""
        self.bounds = np.concatenate(([0], np.cumsum([e.end - e.start for e in events])))
        self.counted = np.concatenate([np.arange(e.start, e.end) >= e.counted for e in events])
        """(n,): rows whose innovation is judged."""
        self.counted_bounds = np.concatenate(([0], np.cumsum([e.end - e.counted for e in events])))
        """(events + 1,): event i has the judged rows from counted_bounds[i] to counted_bounds[i + 1]."""
        skipped = round(RATE_DELAY * measurement.recording.sample_rate)
        near = np.zeros(self.samples.size, np.bool_)
        for event, bound in zip(events, self.bounds, strict=False):
            for opening in event.openings:
                end = opening.last + 1 - int(measurement.means)
                near[bound + opening.first - event.start + skipped : bound + end - event.start] = True
        self.rate_rows = np.flatnonzero(near)
        """(m,): rows at which a measured rate is judged, if the line pressure is not recorded late.

        The needle is open there for RATE_DELAY or longer: how the sac begins to fill is uncertain, by the noise of
        the lift and an orifice law that is smooth at low pressure. The mean in which the needle shuts does not count.
        """
        self.rate_samples = self.samples[self.rate_rows]
        self._injecting = np.concatenate([in_mass_window(measurement, e, np.arange(e.start, e.end)) for e in events])
        self._interval = measurement.interval

    def volumes(self, rate: NDArray[np.float64]) -> NDArray[np.float64]:
        """Volume of every event (w,) [m3] by the injection rate (n,) [m3/s] of its rows."""
        inside = np.where(self._injecting, rate, 0.0)
        return np.add.reduceat(inside, self.bounds[:-1]) * self._interval
