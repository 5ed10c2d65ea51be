"""A needle whose lift was not recorded: its commands, the lift by them, and the jitter of its shots."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.needle import CORNER_ROUNDING, NeedleStroke, lift_of_stroke, stroke_of
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effects import effective_model
from observer_rt.model.hydraulics import AT
from observer_rt.model.parameters import InjectorParameters

SEEN_LATE = 0.5  # samples, on average, by which a command shows


def commands_of(recording: Recording) -> NDArray[np.float64]:
    """Starts and ends of energizing (k, 2), in samples: half a sample before the first that shows them."""
    is_on = np.asarray(recording.arrays["energizing"] > 0.5)
    edges = np.flatnonzero(np.diff(is_on, prepend=False, append=False)).astype(np.float64)
    return np.asarray(edges.reshape(-1, 2) - SEEN_LATE)


def with_commanded_lift(injector: InjectorParameters, recordings: Sequence[Recording]) -> list[Recording]:
    """Recordings with the lift by which an injector's needle would answer their commands."""
    needle, results = effective_model(injector).injector.needle_law, []
    for recording in recordings:
        rate, commands = recording.sample_rate, commands_of(recording)
        pressures = recording.rail_pressure[commands[:, 0].astype(np.int64)] / AT
        spans = zip(*commands.T / rate, pressures, strict=True)
        answers = [stroke_of(start, end - start, pressure, needle) for start, end, pressure in spans]
        strokes = [(0, NeedleStroke(**answer)) for answer in answers if answer is not None]
        results.append(with_lift(recording, strokes))
    return results


def with_lift(recording: Recording, strokes: Iterable[tuple[int, NeedleStroke]]) -> Recording:
    """A recording with the lift by strokes, each after the sample that its times [s] count from."""
    lift, rate = np.zeros(recording.samples), recording.sample_rate
    for first, stroke in strokes:
        begin = max(int(first + (stroke.opening - CORNER_ROUNDING) * rate), 0)
        end = min(int(first + (stroke.closed + CORNER_ROUNDING) * rate), lift.size)
        for sample in range(begin, end):
            lift[sample] = lift_of_stroke((sample - first) / rate, stroke)
    return replace(recording, needle_lift=lift)


def without_jitter(
    z: NDArray[np.float64], moved: NDArray[np.float64], bounds: NDArray[np.int64]
) -> tuple[NDArray[np.float64], float]:
    """White innovations (n,), and the sum of the logarithms of their standard deviations beyond 1.

    moved (n, columns): by one standard deviation of the delays of every shot, drawn anew in each event; bounds
    (events + 1,): of the events. Exact as far as innovations go straight with delays, for Gaussian ones.
    """
    result, logs = z.copy(), 0.0
    for first, end in pairwise(bounds.tolist()):
        by_shots = moved[first:end]
        variances, axes = np.linalg.eigh(by_shots.T @ by_shots)
        spread = np.sqrt(1.0 + np.maximum(variances, 0.0))
        along = axes.T @ (by_shots.T @ z[first:end])
        result[first:end] -= by_shots @ (axes @ (along / (spread * (1.0 + spread))))
        logs += float(np.sum(np.log(spread)))
    return result, logs
