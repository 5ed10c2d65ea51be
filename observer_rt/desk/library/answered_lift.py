"""The lift of a needle that is not measured: as it answers its commands, each shot a little earlier or later."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.needle import NEEDLE_JITTER
from observer_rt.identification.fit.cross_validation import standstill
from observer_rt.identification.likelihood.commands import commanded_lift, commands_of
from observer_rt.identification.likelihood.likelihood import RecordingLikelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters

_STEPS = 3  # of Gauss and Newton, for the delays of shots
_DIFFERENCE = 2e-6  # s


def answered_again(injector: InjectorParameters, recordings: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Measurements with the commands that the needle would answer as each shot did, and with the lift by them.

    Raises as `measurements`.
    """
    model = effective_model(injector)
    commands = [_answered(model, one, commands_of(one.recording)) for one in recordings]
    lifted = [commanded_lift(injector, one.recording, of) for one, of in zip(recordings, commands, strict=True)]
    return tuple(
        replace(new, stated=old.stated, commands=of)
        for new, old, of in zip(measurements(lifted), recordings, commands, strict=True)
    )


def _answered(model: EffectiveModel, measurement: Measurement, commands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Commands (k, 2) moved by the likeliest delays of the shots: one more of every event at a time is varied."""
    sigma, step = NEEDLE_JITTER / measurement.interval, _DIFFERENCE / measurement.interval
    model = model.with_terms("sensor", offset=model.sensor.offset + standstill(measurement)[0])
    events, begun = measurement.events, commands[:, 0]
    sizes = [event.end - event.counted for event in events]
    shots = [np.flatnonzero((begun >= event.start) & (begun < event.end)) for event in events]

    def innovations(late: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        judged = RecordingLikelihood(replace(measurement, commands=commands + late), model).judge(model)
        z = np.zeros(sum(sizes)) if judged is None else judged.z  # without a solution nothing is told
        return np.split(z, np.cumsum(sizes)[:-1])

    late = np.zeros_like(commands)
    for _ in range(_STEPS):
        here, slopes = innovations(late), []
        for number in range(max(map(len, shots))):
            of_event = [each[number] for each in shots if number < len(each)]
            for edge in range(2):
                moved = late.copy()
                moved[of_event, edge] += step
                slopes.append([(z - z_0) / step for z, z_0 in zip(innovations(moved), here, strict=True)])
        for event, (rows, z) in enumerate(zip(shots, here, strict=True)):
            slope = np.column_stack([of[event] for of in slopes[: 2 * len(rows)]])
            information = slope.T @ slope + np.eye(2 * len(rows)) / sigma**2
            gradient = slope.T @ z + late[rows].ravel() / sigma**2
            late[rows] -= np.linalg.solve(information, gradient).reshape(-1, 2)
    return commands + late
