"""A lift that was sampled between the samples of the line pressure loses nothing by it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.desk.simulation.plant import Truth
from tests.engine.sample_stream import Stream, true_course

RATE = 20e3
PHASES = 7  # of the samples against the openings


def truth() -> Truth:
    """One opening for each phase, 30 ms apart."""
    return true_course(PHASES, 30e-3 + 1 / (PHASES * RATE), (1.1e-3,))


def at(signal: NDArray[np.float64], time: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.interp(time, truth().time, signal)


def rmse(lift: NDArray[np.float64], time: NDArray[np.float64], lift_after: float) -> float:
    """Of the rate [m3/s] over all injections, with the lift [m] of each sample taken so much later."""
    stream = Stream(sample_rate=RATE)
    stream.feed(at(truth().rail_pressure, time), lift, at(truth().line_pressure, time), lift_after=lift_after)
    rows = stream.finish().rows
    error = rows["injection_rate"] - at(truth().injection_rate, time)
    return float(np.sqrt(np.nanmean(error[~rows["resting"]] ** 2)))


@pytest.mark.parametrize("after", [0.25, 0.5, 0.8])
def test_rate_is_as_good_as_with_one_clock(after: float) -> None:
    time = np.arange(round((truth().time[-1] - 1e-4) * RATE)) / RATE
    lift = truth().needle_lift
    together = rmse(at(lift, time), time, 0.0)
    between = rmse(at(lift, time + after / RATE), time, after)
    lifts = at(lift, time + (after - 1.0) / RATE), at(lift, time + after / RATE)
    on_a_line = rmse(after * lifts[0] + (1.0 - after) * lifts[1], time, 0.0)
    assert between < 1.6 * together
    assert on_a_line > 2.5 * between  # what it would cost to bring the lift to the samples
