"""Seat area from the measured lift: stated lags undone, dead band with hysteresis, look-back to the foot of the ramp.

A lift recorded too low (`lift_offset` > 0) does not show the lowest part of a ramp, its toe: there the ramp is
extended to where the needle leaves or meets its seat. So it is in the first and the last sample of a lift that are
means, for they hold only a part of a ramp.

Stated lags are undone sample by sample. A rail pressure that is late is taken from later samples, on a straight line
between two. A lift y whose sensor has the time constant tau is y + tau y', by central differences: they leave ramps
as straight as they are, and what they take from one sample beside a corner they give to the next.
"""

import math

from observer_rt.core.stream.stream import FEWEST_OPENING, LOOK_BACK, SLOWEST_OPENING
from observer_rt.engine.stream.state import Undoing
from observer_rt.model.effective import InputTerms

OPENING = 40e-6  # s above the dead band that open it: less is a spike
MOST_OPENING = 8  # samples of that
RAMP = 30e-6  # s of a ramp from which its slope is taken, behind its first sample
LONGEST_RAMP = LOOK_BACK + FEWEST_OPENING - 2  # samples; so many are known when the slope is needed


def toe_samples(inputs: InputTerms, interval: float) -> int:
    """Most samples of an opening ramp that the recorded lift does not show; sample interval [s]."""
    return math.ceil(max(inputs.lift_shift, 0.0) / (SLOWEST_OPENING * interval))


def confirming_samples(interval: float) -> int:
    """Samples in a row above the dead band that open the needle; sample interval [s]."""
    return min(max(round(OPENING / interval), FEWEST_OPENING), MOST_OPENING)


def samples_ahead(interval: float) -> int:
    """Samples the front end must know beyond the first recorded as open; sample interval [s]."""
    return LOOK_BACK + confirming_samples(interval) - 1


def ramp_samples(interval: float) -> int:
    """Samples behind the first of a ramp from which its slope is taken; sample interval [s]."""
    return min(max(round(RAMP / interval), 1), LONGEST_RAMP)


def undoing_of(inputs: InputTerms, interval: float) -> Undoing:
    """Corrections to undo at a sample interval [s]."""
    late = inputs.rail_delay / interval
    whole_samples = math.floor(late)
    ahead = max(math.ceil(late), int(inputs.lift_lag > 0.0), 0)
    stated = inputs.rail_delay != 0.0 or inputs.lift_lag != 0.0
    return Undoing(stated, whole_samples, late - whole_samples, inputs.lift_lag / interval, ahead)


def noise_gain(lag: float) -> float:
    """Factor on the white noise of a lift where a lag of its sensor [samples] is undone."""
    return math.sqrt(1.0 + 0.5 * lag**2)  # of central differences
