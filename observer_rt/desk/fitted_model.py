"""A model fitted to healthy recordings, with what the observer leaves of them: for the command and the library."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from observer_rt.desk.evaluation.healthy_events import observer_remainder
from observer_rt.identification.fit.calibrate import CalibrationResult, baseline_of, calibrate, rounded
from observer_rt.identification.fit.cross_validation import sensor_gain
from observer_rt.identification.fit.masses import MeanMass
from observer_rt.identification.likelihood.measurement import Measurement, without_gain
from observer_rt.model.accuracy import StatedAccuracy
from observer_rt.model.baseline import Baseline
from observer_rt.model.parameters import InjectorParameters


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A fit, and the section [baseline] of its file."""

    done: CalibrationResult
    baseline: Baseline


def fitted_model(
    start: InjectorParameters,
    measurements: Sequence[Measurement],
    weighed: Mapping[int, MeanMass],
    digests: dict[str, str],
    progress: Callable[[float], None],
    calibration: StatedAccuracy,
) -> FittedModel:
    """Fit a model; weighed: measured masses by the number of the recording; digests: SHA-256 of recordings by name.

    calibration: of the pressure sensors, whose gain is taken out before.
    Raises `RunError` where no structure has a solution.
    """
    gain = sensor_gain(measurements, calibration)
    level = calibration.level(gain)
    if gain != 0.0:
        measurements = without_gain(measurements, gain, level)
        weighed = {number: one.by(level) for number, one in weighed.items()}
    done = replace(calibrate(start, measurements, weighed, progress), flow_level=level)
    baseline = baseline_of(done, digests)
    try:
        observer = observer_remainder(done.injector, baseline, [one.recording for one in measurements])
    except (ArithmeticError, ValueError) as error:  # a model so far off that the observer's numbers fail
        done = replace(done, not_observed=str(error))
        observer, baseline = None, baseline.model_copy(update={"adequate": False})
    left = {"observer": observer, "line_pressure_sensor_gain": rounded(gain)}
    return FittedModel(done, baseline.model_copy(update=left))
