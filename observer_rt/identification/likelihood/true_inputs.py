"""True inputs of a recording: its rail pressure, and the seat area of its lift, corrected by the terms of a model."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.identification.areas import fill_areas
from observer_rt.core.model.model import InputTerms
from observer_rt.core.model.needle import NEEDLE_NUMBERS, NeedleLaw, commanded_areas
from observer_rt.core.stream.stream import dead_band
from observer_rt.identification.likelihood.channel_noise import rail_on_time
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.openings import Opening, openings_without_lag, without_lag
from observer_rt.model.effective import Coefficients
from observer_rt.model.hydraulics import CONTROL_REFERENCE

FOOT_ROUNDING = 8e-6  # s before and after a needle leaves or meets its seat, in which it gathers speed


class TrueInputs:
    """True inputs of a recording under input terms, normalised, for every sample: rail (n,) and area (n,).

    A mean over the sample period that ends at a sample's time is the value half a period before. So the rail pressure
    of means is moved to the times of the samples, and the area has its corners, the knots (n, 2), between them.
    """

    def __init__(
        self,
        measurement: Measurement,
        terms: InputTerms,
        c: Coefficients,
        rail: NDArray[np.float64] | None = None,
        needle: NeedleLaw | None = None,
    ) -> None:
        """rail: `rail_on_time` of the same terms, if computed before; needle: answers commands, if there are any."""
        rail = terms.rail_factor * (rail_on_time(measurement, terms) if rail is None else rail) + terms.rail_shift
        self.rail = (rail - c.chamber_pressure) / c.pressure_scale
        if needle is None or measurement.commands is None:
            self.area = _areas(measurement, terms, c)
        else:
            self.area = _answered_areas(measurement, measurement.commands, needle, c)
        self.knots = np.empty((0, 2))
        if measurement.means:
            later = np.append(self.area[1:], self.area[-1])
            self.knots = np.column_stack([np.full(later.size, 0.5), later])
            self.area = 0.5 * (self.area + later)


def _answered_areas(
    measurement: Measurement, commands: NDArray[np.float64], needle: NeedleLaw, c: Coefficients
) -> NDArray[np.float64]:
    """Normalised seat areas (n,) of a needle that answers commands (k, 2)."""
    recording, n, nothing = measurement.recording, measurement.recording.samples, np.zeros(NEEDLE_NUMBERS)
    pressures = np.nan_to_num(recording.rail_pressure[commands[:, 0].astype(np.int64)] / CONTROL_REFERENCE, nan=1.0)
    area, slopes, shots = np.zeros(n), np.zeros((n, NEEDLE_NUMBERS)), np.zeros(n, np.int64)
    commanded_areas(commands, pressures, needle, nothing, c.seat, measurement.interval, area, slopes, shots)
    return area


def _areas(measurement: Measurement, terms: InputTerms, c: Coefficients) -> NDArray[np.float64]:
    """Normalised seat areas (n,) of the true lift, at the times of its samples."""
    lift, noise = measurement.recording.needle_lift, measurement.noise.needle_lift
    openings = [o for event in measurement.events for o in event.openings]
    if terms.lift_lag <= 0.0:
        return _areas_of(measurement, lift, openings, terms, c)
    rate = measurement.recording.sample_rate
    restored = without_lag(lift, rate, terms.lift_lag)
    area = np.zeros(lift.size)
    for share, openings_at_lag in openings_without_lag(lift, noise, openings, rate, terms.lift_lag):
        area += share * _areas_of(measurement, restored, openings_at_lag, terms, c)
    return area


def _areas_of(
    measurement: Measurement,
    lift: NDArray[np.float64],
    openings: Sequence[Opening],
    terms: InputTerms,
    c: Coefficients,
) -> NDArray[np.float64]:
    """Normalised seat areas (n,) of a lift [m] (n,) without lag, with its openings."""
    area = np.zeros(lift.size)
    if not openings:
        return area
    _, shuts = dead_band(measurement.noise.needle_lift)
    edges = np.array([(o.first, o.last) for o in openings])
    ramps = np.array([(o.rising.lift, o.rising.slope, o.falling.lift, o.falling.slope) for o in openings])
    correction = terms.lift_factor, terms.lift_shift, FOOT_ROUNDING / measurement.interval
    fill_areas(lift, edges, ramps, *correction, measurement.means, shuts, c.seat, area)
    return area
