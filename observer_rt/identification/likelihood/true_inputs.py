"""True inputs of a recording by a model's terms: rail pressure and seat area, and the noise they pass on."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from observer_rt.core.identification.areas import fill_areas
from observer_rt.core.model.model import InputTerms
from observer_rt.core.model.needle import NEEDLE_NUMBERS, NeedleLaw, commanded_areas
from observer_rt.core.stream.stream import dead_band
from observer_rt.engine.estimation.predictor import smoothed
from observer_rt.foundation.units import Floats
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.openings import Opening, openings_without_lag, without_lag
from observer_rt.model.effective import Coefficients
from observer_rt.model.hydraulics import CONTROL_REFERENCE

MOVING_SHARE = 0.5  # of the noise: by so much the rail moves in events where its delay can be seen at all
NOISE_DRAWS = 8  # of the lift's noise, by which a variance is found
LAG_GRID = 6e-6  # s of lag, at whose multiples it is found
AVERAGED_SAMPLES = 15  # samples over which it is averaged

Innovations = Callable[[Measurement, float], Floats]
"""Normalised innovations (n,) of a recording with a lag [s] of its lift undone."""
FOOT_ROUNDING = 8e-6  # s before and after a needle leaves or meets its seat, in which it gathers speed


def true_rail_pressure(measurement: Measurement, delay: float) -> Floats:
    """Rail pressure [Pa] (n,), smoothed, of a channel `delay` [s] late; not at rest, where noise fits some delay."""
    rail = measurement.recording.rail_pressure
    available = np.isfinite(rail)
    if not available.all():  # outside of what is judged, but within the kernel's reach
        sample = np.arange(rail.size)
        rail = np.interp(sample, sample[available], rail[available])
    return smoothed(rail, measurement.interval, delay / measurement.interval if _moves(measurement) else 0.0)


def rail_on_time(measurement: Measurement, terms: InputTerms) -> Floats:
    """Recorded rail pressure [Pa] (n,), smoothed, at the times of the other two channels."""
    half_period = 0.5 * measurement.interval if measurement.means else 0.0
    return true_rail_pressure(measurement, terms.rail_delay + half_period)


def _moves(measurement: Measurement) -> bool:
    rail, noise = measurement.recording.rail_pressure, measurement.noise.rail_pressure
    variance = np.mean([np.var(rail[event.start : event.end]) for event in measurement.events])
    return bool(variance > (1.0 + MOVING_SHARE**2) * noise**2)


class LiftNoise:
    """Variance that the noise of the lift adds to the normalised innovations of a recording, by the lag."""

    def __init__(self, measurement: Measurement, innovations: Innovations) -> None:
        self._measurement = measurement
        self._innovations = innovations
        self._cache: dict[int, Floats] = {}

    def variance(self, lag: float) -> Floats:
        """Variance (n,) added by a lag [s], linear between multiples of `LAG_GRID`, so that a fit meets no step."""
        below = math.floor(lag / LAG_GRID)
        share = lag / LAG_GRID - below
        added = (1.0 - share) * self._at(below) + share * self._at(below + 1)
        return np.asarray(np.maximum(added - self._at(0), 0.0))

    def _at(self, multiple: int) -> Floats:
        if multiple in self._cache:
            return self._cache[multiple]
        measurement, lag, rng = self._measurement, multiple * LAG_GRID, np.random.default_rng(0)
        recording = measurement.recording
        undisturbed = self._innovations(measurement, lag)
        squares = np.zeros(undisturbed.size)
        for _ in range(NOISE_DRAWS):
            noise = rng.normal(0.0, measurement.noise.needle_lift, recording.samples)
            louder = replace(recording, needle_lift=recording.needle_lift + noise)
            squares += (self._innovations(replace(measurement, recording=louder), lag) - undisturbed) ** 2
        mean = np.convolve(squares / NOISE_DRAWS, np.full(AVERAGED_SAMPLES, 1.0 / AVERAGED_SAMPLES), mode="same")
        self._cache[multiple] = variance = np.where(np.isfinite(mean), mean, 0.0)
        return variance


class TrueInputs:
    """True inputs of a recording under input terms, normalised, for every sample: rail (n,) and area (n,).

    A mean over a period is the value half a period before: rail means are moved to the samples' times, and the area
    has its corners, the knots (n, 2), between them.
    """

    def __init__(
        self,
        measurement: Measurement,
        terms: InputTerms,
        c: Coefficients,
        rail: Floats | None = None,
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


def _answered_areas(measurement: Measurement, commands: Floats, needle: NeedleLaw, c: Coefficients) -> Floats:
    recording, n, nothing = measurement.recording, measurement.recording.samples, np.zeros(NEEDLE_NUMBERS)
    pressures = np.nan_to_num(recording.rail_pressure[commands[:, 0].astype(np.int64)] / CONTROL_REFERENCE, nan=1.0)
    area, slopes, shots = np.zeros(n), np.zeros((n, NEEDLE_NUMBERS)), np.zeros(n, np.int64)
    commanded_areas(commands, pressures, needle, nothing, c.seat, measurement.interval, area, slopes, shots)
    return area


def _areas(measurement: Measurement, terms: InputTerms, c: Coefficients) -> Floats:
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
    measurement: Measurement, lift: Floats, openings: Sequence[Opening], terms: InputTerms, c: Coefficients
) -> Floats:
    area = np.zeros(lift.size)
    if not openings:
        return area
    _, shuts = dead_band(measurement.noise.needle_lift)
    edges = np.array([(o.first, o.last) for o in openings])
    ramps = np.array([(o.rising.lift, o.rising.slope, o.falling.lift, o.falling.slope) for o in openings])
    correction = terms.lift_factor, terms.lift_shift, FOOT_ROUNDING / measurement.interval
    fill_areas(lift, edges, ramps, *correction, measurement.means, shuts, c.seat, area)
    return area
