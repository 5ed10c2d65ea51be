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
from observer_rt.identification.likelihood.windows import Rows
from observer_rt.model.effective import EffectiveModel


def rate_misfit(calibration: Calibration, judged: Sequence[JudgedModel]) -> float:
    """Root mean square of a measured rate minus the modelled one, beyond noise, over that of the rate; 0 without."""
    beyond, total = 0.0, 0.0
    for fold, model in zip(calibration.folds, judged, strict=True):
        rate, z = fold.measurement.recording.injection_rate, model.rate_z[:-1]
        if rate is not None:
            beyond += fold.measurement.rate_noise**2 * max(float(z @ z) - z.size, 0.0)
            total += float(np.sum(rate[Rows(fold.measurement).rate_samples] ** 2))
    return math.sqrt(beyond / total) if total else 0.0


def rate_meter(measured: Sequence[Measurement], model: EffectiveModel) -> tuple[float, float]:
    """Time constants [s] of a meter of two poles with which a model's rate has the shape of the measured one.

    Its gain is free: the level is not the meter's.
    """
    pairs = [
        (one.interval, run.rate, one.recording.injection_rate[run.rate_samples])
        for one in measured
        if one.recording.injection_rate is not None
        for run in simulated(one, model)
    ]
    rate = np.concatenate([each for _, _, each in pairs])

    def missed(lags: NDArray[np.float64]) -> NDArray[np.float64]:
        shown = np.concatenate([shown_slowly(each, interval, *lags) for interval, each, _ in pairs])
        return np.asarray(rate - shown * (shown @ rate) / (shown @ shown))

    best = least_squares(missed, (1.5e-4, 3e-5), bounds=(1e-6, 2e-3), x_scale=1e-4, diff_step=1e-3)
    slow, quick = sorted(map(float, best.x), reverse=True)
    return slow, quick
