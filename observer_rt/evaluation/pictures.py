"""What is drawn of an evaluated recording."""

from collections.abc import Collection, Sequence

import numpy as np

from observer_rt.estimation.scalars import NOZZLE, SEAT
from observer_rt.evaluation.curves import RateCurves, rate_curves
from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.evaluation.event_axes import MassRow, Picture
from observer_rt.evaluation.results import InjectionResult
from observer_rt.model.coefficients import Coefficients


def picture_of(
    evaluation: Evaluation, results: Sequence[InjectionResult], numbers: Collection[int], c: Coefficients
) -> Picture:
    """Curves of the injections of these numbers, as far as the recording has them; masses and wear of all."""
    return Picture(
        str(evaluation.recording.path),
        {one.report.number: _curves(evaluation, one, c) for one in results if one.report.number in numbers},
        [_mass_row(one) for one in results],
    )


def _curves(evaluation: Evaluation, result: InjectionResult, c: Coefficients) -> RateCurves:
    recording = evaluation.recording
    return rate_curves(
        result.report,
        evaluation.first_index,
        recording.time,
        evaluation.trace,
        recording.injection_rate,
        recording.line_pressure,
        c,
    )


def _mass_row(result: InjectionResult) -> MassRow:
    report = result.report
    return MassRow(
        report.number,
        report.mass,
        result.nominal_mass,
        None if np.isnan(result.measured_mass) else result.measured_mass,
        report.valid,
        report.mass_ci95,
        {effect: report.indicators[effect] for effect in (NOZZLE, SEAT)},
    )
