"""Calibration of a model to recordings of the healthy injector: verdict, parameters, residuals, a figure."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from observer_rt.desk.evaluation.healthy_events import observer_remainder
from observer_rt.desk.injection_map import map_document
from observer_rt.desk.injection_map.map_fit import MapFit
from observer_rt.foundation.errors import RunError, UserError, require
from observer_rt.foundation.units import Floats
from observer_rt.identification.fit import forms
from observer_rt.identification.fit.calibrate import CalibrationResult, calibrate
from observer_rt.identification.fit.document import FitDocument, document_of, verdict_words
from observer_rt.identification.fit.fitted_file import baseline_of, rounded
from observer_rt.identification.fit.masses import WeighedMasses, read_masses
from observer_rt.identification.fit.suitability import refuse_clipped, sensor_gain, standstill, warnings
from observer_rt.identification.likelihood.likelihood import RecordingLikelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements, without_gain
from observer_rt.identification.likelihood.reading import commanded_lift, commands_of, refuse_rates_missing
from observer_rt.model.accuracy import StatedAccuracy
from observer_rt.model.baseline import Baseline
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters

TRADED = (
    "without a needle lift, seat.flow_coefficient is known only as its product with the needle's opening speed: "
    "its interval holds for the speed that stands in [needle]"
)
CALIBRATION_TIME = 0.85  # share of all the time; then the observer runs along the recordings
ROUNDS = 3  # of calibration without a measured lift: delays of shots follow from the round before
UNUSUAL_SIGMAS = 2.5  # of a seat's coefficient from usual ones, beyond which it stands in for a needle's speeds


class _Shown:
    """Shows a verdict, and the numbers that it is of."""

    verdict: Any
    parameters: Any

    def __repr__(self) -> str:
        return f"{self.verdict}\n{self.parameters.to_string()}"

    def _repr_html_(self) -> str:
        return f"<p>{self.verdict}</p>{self.parameters.to_html()}"


@dataclass(frozen=True, eq=False, repr=False)
class FitResult(_Shown):
    """A fit, as `Injector.fit` gives it. baseline: section of its file; warnings: doubts about the recordings.

    notes: what was noted while they were read.
    """

    done: CalibrationResult
    baseline: Baseline
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def adequate(self) -> bool:
        """Whether the model explains its recordings."""
        return self.baseline.adequate

    @property
    def verdict(self) -> str:
        """Verdict in words, with what to try where it is not adequate."""
        return verdict_words(self.done)

    @cached_property
    def parameters(self) -> pd.DataFrame:
        """Parameters fitted, by name: value, 95 % interval, value of the file before, unit, symbol."""
        return _frame_of(self.done.sizes)

    @cached_property
    def document(self) -> FitDocument:
        """The document that `observer-rt fit --json` writes."""
        return document_of(self.done, self.baseline, self.warnings)

    def plot(self) -> Any:
        """Draw line pressures before and after the fit, and residuals by phase: a matplotlib Figure."""
        require("matplotlib")
        from observer_rt.identification.fit.report import fit_figure

        return fit_figure(self.done)


@dataclass(frozen=True, eq=False, repr=False)
class MapResult(_Shown):
    """A fit to a map of masses, as `Injector.fit_map` gives it."""

    done: MapFit

    @property
    def verdict(self) -> str:
        """How well the injector explains its map, and where not."""
        return self.document.verdict_words

    @cached_property
    def parameters(self) -> pd.DataFrame:
        """Numbers by name: value, 95 % interval, value of the file before, unit, symbol."""
        return _frame_of(self.document.parameters)

    @cached_property
    def points(self) -> pd.DataFrame:
        """Masses measured and fitted, a row a point."""
        return pd.DataFrame([point.model_dump() for point in self.document.points])

    @cached_property
    def document(self) -> map_document.MapDocument:
        """The document that `observer-rt fit --map --json` writes."""
        return map_document.document_of(self.done)

    def plot(self) -> Any:
        """Draw masses, measured and fitted: a matplotlib Figure."""
        require("matplotlib")
        from observer_rt.desk.injection_map.map_report import map_figure

        return map_figure(self.done)


def _frame_of(numbers: Mapping[str, forms.FittedNumber]) -> pd.DataFrame:
    """Fitted numbers, a row each."""
    frame = pd.DataFrame.from_dict({name: asdict(number) for name, number in numbers.items()}, orient="index")
    low_high = pd.DataFrame(frame.pop("ci95").tolist(), index=frame.index, columns=["low", "high"])
    return frame[["symbol", "value"]].join(low_high).join(frame[["file", "unit"]])


def weighed_masses(
    measured: Sequence[Measurement], masses: Path | None, injector: InjectorParameters
) -> Mapping[int, WeighedMasses]:
    """Measured masses by the number of the recording; masses: their file, None: none were measured.

    Raises `UserError` for it, and for recordings that no model can be fitted to.
    """
    refuse_rates_missing([measurement.recording for measurement in measured])
    refuse_clipped(measured)
    return {} if masses is None else read_masses(masses, measured, effective_model(injector).coefficients.density)


def fitted_model(
    start: InjectorParameters,
    measurements: Sequence[Measurement],
    weighed: Mapping[int, WeighedMasses],
    digests: dict[str, str],
    progress: Callable[[float], None],
    calibration: StatedAccuracy,
) -> FitResult:
    """Fit a model; weighed: measured masses by the number of the recording; digests: SHA-256 of recordings by name.

    calibration: of the pressure sensors, whose gain is taken out before.
    Raises `RunError` where no structure has a solution.
    """
    doubts = [*warnings(measurements)]
    gain = sensor_gain(measurements, calibration)
    factor = calibration.level(gain)
    if gain != 0.0:
        measurements = without_gain(measurements, gain, factor)
        weighed = {n: {at: mass.by(factor) for at, mass in of.items()} for n, of in weighed.items()}

    def tell(share: float) -> None:
        progress(CALIBRATION_TIME * share)

    if measurements[0].is_answered:
        doubts.append(TRADED)
        done = _with_needle(start, measurements, weighed, tell)
    else:
        done = calibrate(start, measurements, weighed, tell)
    done = replace(done, flow_factor=factor)
    baseline = baseline_of(done, digests)
    try:
        observer = observer_remainder(done.injector, baseline, [used.recording for used in done.measurements])
    except (ArithmeticError, ValueError) as error:  # a model so far off that the observer's numbers fail
        done = replace(done, not_observed=str(error))
        observer, baseline = None, baseline.model_copy(update={"adequate": False})
    left = {"observer": observer, "line_pressure_sensor_gain": rounded(gain)}
    return FitResult(done, baseline.model_copy(update=left), tuple(doubts))


def _with_needle(
    start: InjectorParameters,
    measurements: Sequence[Measurement],
    weighed: Mapping[int, WeighedMasses],
    progress: Callable[[float], None],
) -> CalibrationResult:
    """Calibrate where no lift was measured: from the file's needle, and from others if the model then lacks much."""
    done = _in_turn(start, measurements, weighed, forms.STRUCTURES, lambda share: progress(0.5 * share))
    if not any(_rank(done)[:2]):
        return done
    structures = [one.of_any_needle for one in forms.STRUCTURES]
    try:
        other = _in_turn(start, measurements, weighed, structures, lambda share: progress(0.5 + 0.5 * share))
    except (RunError, UserError):  # what there is stays
        return done
    return min(done, other, key=_rank)


def _rank(done: CalibrationResult) -> tuple[bool, bool, float]:
    """Whether more than noise is left, and the seat is unusual, and the mean chi2: the lowest is the best."""
    seat = forms.USUAL_SEAT
    off = abs(seat.of(done.injector) - seat.start) / seat.linear
    return bool(done.above_limit), off > UNUSUAL_SIGMAS * seat.spread, done.comparison.unexplained.mean


def _in_turn(
    start: InjectorParameters,
    measurements: Sequence[Measurement],
    weighed: Mapping[int, WeighedMasses],
    structures: Sequence[forms.Structure],
    progress: Callable[[float], None],
) -> CalibrationResult:
    """Calibrate in turn line and needle together, and the delays of single shots by them.

    In the first round all shots answer alike, so that only plain structures are tried; rounds between keep the one
    that was chosen, and the last tries all.
    """

    def calibrated(number: int, structures: Sequence[forms.Structure]) -> CalibrationResult:
        return calibrate(start, measurements, weighed, lambda share: progress((number + share) / ROUNDS), structures)

    passed = forms.FLOW_STARTS if forms.USUAL_SEAT in structures[0].free else forms.NEEDLE
    done = calibrated(0, structures[: len(forms.PLAIN)])
    for number in range(1, ROUNDS):
        measurements = answered_again(done.injector, measurements)
        start = forms.with_values(start, passed, forms.values_of(done.injector, passed))
        done = calibrated(number, structures if number == ROUNDS - 1 else [done.fitted.structure])
    return done


def answered_again(injector: InjectorParameters, recordings: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Measurements with commands moved by their shots' delays, and the lift by these; raises as `measurements`."""
    model = effective_model(injector)
    commands = [_answered(model, recording) for recording in recordings]
    lifted = [commanded_lift(injector, old.recording, of) for old, of in zip(recordings, commands, strict=True)]
    return tuple(
        replace(new, stated=old.stated, commands=of)
        for new, old, of in zip(measurements(lifted), recordings, commands, strict=True)
    )


def _answered(model: EffectiveModel, measurement: Measurement) -> Floats:
    """Commands (k, 2) moved by the likeliest delays of the shots."""
    commands = commands_of(measurement.recording)
    model = model.with_changes("sensor", offset=model.sensor.offset + standstill(measurement)[0])
    free = replace(measurement, commands=commands, is_free=True)
    moved = commands.copy()
    for event, late in zip(free.events, RecordingLikelihood(free, model).late_shots(model), strict=True):
        moved[free.shots_in(event)] += late / free.interval
    return moved
