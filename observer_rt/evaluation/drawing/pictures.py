"""What is drawn of an evaluated recording."""

from collections.abc import Collection

import numpy as np

from observer_rt.estimation.scalars import NOZZLE, SEAT
from observer_rt.evaluation.drawing.event_axes import MassRow, Picture
from observer_rt.evaluation.injections import InjectionResult
from observer_rt.evaluation.streamed import StreamedEvaluation


def picture_of(evaluation: StreamedEvaluation, numbers: Collection[int]) -> Picture:
    """Curves of the injections of these numbers, as far as the recording has them; masses and wear of all."""
    curves = {
        one.report.number: evaluation.curves[place]
        for place, one in enumerate(evaluation.injections)
        if one.report.number in numbers
    }
    return Picture(str(evaluation.path), curves, [_mass_row(one) for one in evaluation.injections])


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
