"""A measured injection rate beside that of a model: its samples, and its integral over every event.

Its gain has an error, the same in the whole recording, which is estimated with its prior: exact for a Gaussian one.
"""

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.stream.state import noise_gain
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.rows import Rows

GAIN_ERROR = 0.005  # standard deviation of the gain
METER_ERROR = 0.05  # of the time constants of the meter
VOLUME_ERROR = 0.002  # of the integral over an event, beyond noise


def rate_as_recorded(measurement: Measurement, rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """A modelled injection rate (n,) as it would be recorded: averaged over each period if samples are means."""
    if not measurement.means:
        return rate
    beyond = np.concatenate([rate[:1], rate, rate[-1:]])
    middle = 13.0 * (rate[1:] + rate[:-1]) - beyond[:-3] - beyond[3:]  # of the cubic through four samples
    return np.append(rate[:1], middle / 24.0)


def as_by_meter(measurement: Measurement, rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """A modelled injection rate (n,) as the meter shows it; events lie so far apart that it rests before each."""
    return shown_slowly(rate, measurement.interval, *(measurement.recording.meter or ()))


class MeasuredRate:
    """The measured rate of a recording at the m judged samples, and over its events."""

    def __init__(self, measurement: Measurement, rows: Rows, by_lift: NDArray[np.float64]) -> None:
        """by_lift: standard deviation of the modelled rate (m,) [m3/s] by lift, jitter and meter as recorded."""
        rate = measurement.recording.injection_rate
        assert rate is not None
        self._rate, self._volumes = rate[rows.rate_samples], rows.volumes(rate[rows.samples])
        self._noise, self._interval, self._by_lift = measurement.rate_noise, measurement.interval, by_lift
        injecting = rows.volumes(np.ones(rows.samples.size))
        self._volume_noise = self._noise * np.sqrt(injecting * self._interval)
        self._sigma = self._sigma_at(0.0)

    def residuals(self, rate: NDArray[np.float64], lift_lag: float) -> tuple[NDArray[np.float64], float]:
        """Residuals (m + 1,) of a modelled rate (m,), and the mean rise of log sigma by a lag of the lift [s]."""
        sigma = self._sigma_at(lift_lag) if lift_lag > 0.0 else self._sigma
        return _without_gain_error(self._rate, rate, sigma), float(np.mean(np.log(sigma / self._sigma)))

    def volume_residuals(self, volumes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals (events + 1,) of modelled integrals (events,) as the meter shows them."""
        return _without_gain_error(self._volumes, volumes, np.hypot(self._volume_noise, VOLUME_ERROR * volumes))

    def _sigma_at(self, lift_lag: float) -> NDArray[np.float64]:
        """Standard deviation (m,) of measured minus modelled rate: its own noise, and that of the restored lift."""
        by_lift = noise_gain(lift_lag / self._interval) * self._by_lift
        return np.asarray(np.hypot(self._noise, by_lift), np.float64)


def _without_gain_error(
    measured: NDArray[np.float64], modelled: NDArray[np.float64], sigma: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Normalised residuals (n + 1,) of measured values (n,) without the gain error, which is appended in sigmas."""
    residual, scale = (measured - modelled) / sigma, modelled / sigma
    gain = float(scale @ residual) / (float(scale @ scale) + GAIN_ERROR**-2)
    return np.append(residual - gain * scale, gain / GAIN_ERROR)
