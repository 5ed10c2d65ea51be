"""The lift of a needle that is not measured: as it answers its commands, each shot a little earlier or later."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.fit.cross_validation import standstill
from observer_rt.identification.likelihood.commands import commanded_lift, commands_of
from observer_rt.identification.likelihood.likelihood import RecordingLikelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters


def answered_again(injector: InjectorParameters, recordings: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """Measurements with the commands that the needle would answer as each shot did, and with the lift by them.

    Raises as `measurements`.
    """
    model = effective_model(injector)
    commands = [_answered(model, one) for one in recordings]
    lifted = [commanded_lift(injector, one.recording, of) for one, of in zip(recordings, commands, strict=True)]
    return tuple(
        replace(new, stated=old.stated, commands=of)
        for new, old, of in zip(measurements(lifted), recordings, commands, strict=True)
    )


def _answered(model: EffectiveModel, measurement: Measurement) -> NDArray[np.float64]:
    """Commands (k, 2) moved by the likeliest delays of the shots."""
    commands = commands_of(measurement.recording)
    model = model.with_terms("sensor", offset=model.sensor.offset + standstill(measurement)[0])
    free = replace(measurement, commands=commands, is_free=True)
    moved = commands.copy()
    for event, late in zip(free.events, RecordingLikelihood(free, model).late_shots(model), strict=True):
        moved[free.shots_in(event)] += late / free.interval
    return moved
