"""The commands of a needle whose lift was not recorded, and the lift by which it would answer them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.needle import CORNER_ROUNDING, NeedleStroke, lift_of_stroke, stroke_of
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from observer_rt.model.effects import effective_model
from observer_rt.model.hydraulics import CONTROL_REFERENCE
from observer_rt.model.parameters import InjectorParameters

COMMAND_DELAY = 0.5  # samples, on average, by which a command shows


def commands_of(recording: Recording) -> NDArray[np.float64]:
    """Starts and ends of energizing (k, 2), in samples: half a sample before the first that shows them."""
    is_on = np.asarray(recording.arrays["energizing"] > 0.5)
    edges = np.flatnonzero(np.diff(is_on, prepend=False, append=False)).astype(np.float64)
    return np.asarray(edges.reshape(-1, 2) - COMMAND_DELAY)


def with_commanded_lift(injector: InjectorParameters, recordings: Sequence[Recording]) -> list[Recording]:
    """Recordings with the lift by which a needle answers their commands. Raises `UserError` if it answers none."""
    results = [commanded_lift(injector, one, commands_of(one)) for one in recordings]
    if not any(one.needle_lift.any() for one in results):
        raise UserError(
            str(recordings[0].path or "recording"),
            "no command is answered by the injector file's needle",
            "check `energizing`, and the delays in [needle] of the injector file",
        )
    return results


def commanded_lift(injector: InjectorParameters, recording: Recording, commands: NDArray[np.float64]) -> Recording:
    """A recording with the lift by which an injector's needle would answer commands (k, 2) [samples]."""
    lift, rate = np.zeros(recording.samples), recording.sample_rate
    needle = effective_model(injector).injector.needle_law
    rail_pressures = recording.rail_pressure[commands[:, 0].astype(np.int64)]
    pressures = np.nan_to_num(rail_pressures, nan=CONTROL_REFERENCE) / CONTROL_REFERENCE
    for (start, end), pressure in zip(commands / rate, pressures, strict=True):
        answer = stroke_of(start, end - start, pressure, needle)
        if answer is None:
            continue
        stroke = NeedleStroke(**answer)
        first = (stroke.opening - CORNER_ROUNDING) * rate
        last = (stroke.landed + CORNER_ROUNDING) * rate
        for sample in range(max(int(first), 0), min(int(last), lift.size)):
            lift[sample] = lift_of_stroke(sample / rate, stroke)
    return replace(recording, needle_lift=lift)
