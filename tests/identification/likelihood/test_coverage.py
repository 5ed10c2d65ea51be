"""What is said of a recording before the search."""

from dataclasses import replace

import numpy as np

from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.reading import coverage
from tests.identification.discovery.hidden import recordings

POINT = ((100e6, 1.0e-3),)


def test_a_recording_without_gaps_is_one_line() -> None:
    (one,) = recordings(points=POINT)
    (found,) = measurements([one])
    assert coverage(found) == (
        f"recording: {one.samples} samples at 100000 Hz, no gap, 2 of 2 injections judged"
    )


def test_gaps_and_what_they_cost_are_named() -> None:
    (one,) = recordings(points=POINT)
    (whole,) = measurements([one])
    opening = whole.events[1].openings[0]
    rail, lift = one.rail_pressure.copy(), one.needle_lift.copy()
    rail[:27] = np.nan  # far from any injection
    lift[opening.first + 20 : opening.first + 29] = np.nan
    (found,) = measurements([replace(one, rail_pressure=rail, needle_lift=lift)])
    first, second = coverage(found).splitlines()
    assert first.endswith("2 gaps of 36 samples in all, the longest 0.27 ms, 1 of 2 injections judged")
    assert second == (
        f"  left out, samples are missing in it or beside it: at {one.time[opening.first]:.4f} s"
    )
