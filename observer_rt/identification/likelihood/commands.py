"""A needle whose lift was not recorded: its commands, the lift by them, and the jitter of its shots."""

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

Vector = NDArray[np.float64]
Bounds = NDArray[np.int64]
SEEN_LATE = 0.5  # samples, on average, by which a command shows


def commands_of(recording: Recording) -> NDArray[np.float64]:
    """Starts and ends of energizing (k, 2), in samples: half a sample before the first that shows them."""
    is_on = np.asarray(recording.arrays["energizing"] > 0.5)
    edges = np.flatnonzero(np.diff(is_on, prepend=False, append=False)).astype(np.float64)
    return np.asarray(edges.reshape(-1, 2) - SEEN_LATE)


def with_commanded_lift(injector: InjectorParameters, recordings: Sequence[Recording]) -> list[Recording]:
    """Recordings with the lift by which an injector's needle would answer their commands.

    Raises `UserError` where it answers none.
    """
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


def likelier_delays(z: Vector, delays: Sequence[Vector], moved: Vector, bounds: Bounds) -> list[Vector]:
    """Delays (columns,) of the shots of every event by innovations (n,) at others, in standard deviations.

    moved (n, columns), bounds (events + 1,): as of `without_jitter`.
    """
    results = []
    for delay, first, end in zip(delays, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        by_shots = moved[first:end]
        information = by_shots.T @ by_shots + np.eye(delay.size)
        results.append(delay - np.linalg.solve(information, by_shots.T @ z[first:end] + delay))
    return results


def without_jitter(z: Vector, delays: Sequence[Vector], moved: Vector, bounds: Bounds) -> tuple[Vector, float]:
    """White innovations (n,), and the sum of the logarithms of their standard deviations beyond 1.

    z (n,): at the likely delays; moved (n, columns): by one standard deviation of the delays of every shot, drawn
    anew in each event; bounds (events + 1,): of the events. Exact for Gaussian ones, as far as they go straight.
    """
    result, logs = z.copy(), 0.0
    for delay, first, end in zip(delays, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        by_shots = moved[first:end]
        variances, axes = np.linalg.eigh(by_shots.T @ by_shots)
        spread = np.sqrt(1.0 + np.maximum(variances, 0.0))
        along = axes.T @ (by_shots.T @ z[first:end])
        result[first:end] -= by_shots @ (axes @ ((along / (1.0 + spread) + axes.T @ delay) / spread))
        logs += float(np.sum(np.log(spread)))
    return result, logs
