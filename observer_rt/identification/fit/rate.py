"""Compares a measured injection rate with a model's: the misfit of its shape, and the meter that explains it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from observer_rt.files.signals.recording import shown_slowly
from observer_rt.identification.fit.problem import Calibration
from observer_rt.identification.likelihood.likelihood import JudgedModel
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import simulated
from observer_rt.identification.likelihood.rows import Rows
from observer_rt.model.effective import EffectiveModel


def rate_misfit(calibration: Calibration, judged: Sequence[JudgedModel]) -> float:
    """Root mean square of a measured rate minus the modelled one, beyond noise, over that of the rate; 0 without."""
    beyond, total = 0.0, 0.0
    for fold, model in zip(calibration.folds, judged, strict=True):
        measurement, z = fold.measurement, model.z_of_rate
        if measurement.recording.injection_rate is not None:
            beyond += measurement.rate_noise**2 * max(float(z @ z) - z.size, 0.0)
            total += float(np.sum(measurement.recording.injection_rate[Rows(measurement).rate_samples] ** 2))
    return math.sqrt(beyond / total) if total else 0.0


def rate_meter(measured: Sequence[Measurement], model: EffectiveModel) -> tuple[float, float]:
    """Time constants [s] of a meter of two poles and a free gain that gives a model's rate the measured shape."""
    runs = [
        (one.interval, run.rate, one.recording.injection_rate[run.rate_samples])
        for one in measured
        if one.recording.injection_rate is not None
        for run in simulated(one, model)
    ]
    rate = np.concatenate([recorded for _, _, recorded in runs])

    def missed(lags: NDArray[np.float64]) -> NDArray[np.float64]:
        shown = np.concatenate([shown_slowly(modelled, interval, *lags) for interval, modelled, _ in runs])
        gain = (shown @ rate) / (shown @ shown)
        return np.asarray(rate - shown * gain)

    best = least_squares(missed, (1.5e-4, 3e-5), bounds=(1e-6, 2e-3), x_scale=1e-4, diff_step=1e-3)
    slow, quick = sorted(map(float, best.x), reverse=True)
    return slow, quick
