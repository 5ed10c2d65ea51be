"""Rail pressure as models are driven with it: smoothed, and moved by the delay of its channel.

A line in which pressure travels takes the noise of its rail pressure for pressure. What rounds that noise - a rail
pressure read between two samples, a line pressure taken for late and early at once - would explain any recording
better. So the rail pressure is smoothed first, by one kernel whatever its delay: the same noise is left of it.
"""

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effective import InputTerms

WIDTH = 50e-6  # s, of the kernel: it leaves what a rail does up to some 3 kHz
REACH = 4.0  # widths to either side
MOVING = 0.5  # of the noise: by so much the rail moves in events where its delay can be seen at all


def smoothing_of(interval: float) -> float:
    """Width of the kernel [s] at a sample interval [s]: at least a sample, so that noise does not fix the delay."""
    return max(WIDTH, interval)


def true_rail_pressure(measurement: Measurement, delay: float) -> NDArray[np.float64]:
    """Rail pressure [Pa] (n,), smoothed, of a channel that records it `delay` [s] late.

    The kernel is of fourth order, (3 - u2)/2 times a normal density: parabolas pass as they are. A rail at rest
    during events is not moved: to move its noise is to draw another noise, which some delay always likes.
    """
    rail = measurement.recording.rail_pressure
    late, width = delay / measurement.interval, smoothing_of(measurement.interval) / measurement.interval
    if not _moves(measurement):
        late = 0.0
    available = np.isfinite(rail)
    if not available.all():  # outside of what is judged, but within the kernel's reach
        sample = np.arange(rail.size)
        rail = np.interp(sample, sample[available], rail[available])
    reach = int(np.ceil(REACH * width + abs(late)))
    u = (np.arange(-reach, reach + 1) - late) / width
    weights = (3.0 - u**2) * np.exp(-0.5 * u**2)
    beyond = np.pad(rail, reach, mode="edge")
    return np.asarray(np.convolve(beyond, weights[::-1] / weights.sum(), "valid"), np.float64)


def rail_on_time(measurement: Measurement, terms: InputTerms) -> NDArray[np.float64]:
    """Recorded rail pressure [Pa] (n,), smoothed, at the times of the other two channels."""
    return true_rail_pressure(
        measurement, terms.rail_delay + (0.5 * measurement.interval if measurement.means else 0.0)
    )


def _moves(measurement: Measurement) -> bool:
    """Whether the rail pressure moves within events."""
    rail, noise = measurement.recording.rail_pressure, measurement.noise.rail_pressure
    variance = np.mean([np.var(rail[event.start : event.end]) for event in measurement.events])
    return bool(variance > (1.0 + MOVING**2) * noise**2)
