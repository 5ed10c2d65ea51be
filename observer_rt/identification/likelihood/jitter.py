"""How late the shots of a needle answer its commands, by the innovations that their delays explain.

A shot is one opening of a needle whose lift was not measured. It has two delays, of its opening and of its closing,
each drawn anew in every event: that is its jitter. Innovations change in proportion to delays as short as these.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.likelihood.windows import ShotDelays

Vector = NDArray[np.float64]
Bounds = NDArray[np.int64]
Run = Callable[[ShotDelays], tuple[Vector, Vector]]
"""Innovations (n,) and injection rate (n,) of a model whose shots have these delays."""
DELAY_STEP = 5e-6  # s, of the finite difference by a delay
LEAST_JITTER, WIDEST_JITTER = 12e-6, 60e-6  # s, standard deviations between which that of the jitter lies
MOST_SIGMAS = 5.0  # standard deviations, up to which a delay is followed
ROUNDS = 2  # in which delays are found, the second beginning where the first led


class ShotJitter:
    """Delays of the shots in one recording."""

    def __init__(self, commands: Sequence[Vector], counted: NDArray[np.bool_], bounds: Bounds) -> None:
        """commands: of every event (k, 2); counted: judged innovations; bounds (events + 1,): of events in these."""
        self.nominal_delays = [np.zeros_like(of_event) for of_event in commands]  # (k, 2) by the nominal model [s]
        self.sigma = LEAST_JITTER  # standard deviation of the delays [s]
        self.by_shots = np.empty((0, 0))  # (n, columns) slopes of the judged innovations by a shot of every event
        self._counted, self._bounds = counted, bounds

    def observe(self, run: Run, innovation_sigma: float) -> None:
        """Set the delays to those that a run of the nominal model shows beside their mean, sigma to their scatter."""
        here = run(self.nominal_delays)[0]
        self.by_shots = self._derivatives(run, here, self.nominal_delays)
        moved = self.by_shots * (WIDEST_JITTER / innovation_sigma)
        z, on_time = here[self._counted] / innovation_sigma, np.zeros(moved.shape[1])
        seen = WIDEST_JITTER * np.array(likelier_delays(z, [on_time] * len(self.nominal_delays), moved, self._bounds))
        for delays, later in zip(self.nominal_delays, seen - np.mean(seen, axis=0), strict=True):
            delays += later[: delays.size].reshape(-1, 2)
        squares = sum(float(np.sum(delays**2)) for delays in self.nominal_delays)
        self.sigma = max(LEAST_JITTER, math.sqrt(squares / max(np.size(seen) - len(seen[0]), 1)))

    def likely(
        self, run: Run, innovation_sigma: float, normalised: Callable[[Vector], Vector]
    ) -> tuple[list[Vector], Vector]:
        """Likeliest delays (columns,) of every event beyond the nominal ones, in standard deviations.

        Also, by what one standard deviation of each moves the judged innovations (n, columns), made by `normalised`.
        """
        delays = [np.zeros(self.by_shots.shape[1]) for _ in self.nominal_delays]
        shots: ShotDelays = self.nominal_delays
        moved = self.by_shots * (self.sigma / innovation_sigma)
        for number in range(ROUNDS):
            here, _ = run(shots)
            if number:
                moved = self._derivatives(run, here, shots) * (self.sigma / innovation_sigma)
            delays = likelier_delays(normalised(here), delays, moved, self._bounds)
            shots = self.shots(delays)
        return delays, moved

    def shots(self, delays: Sequence[Vector]) -> ShotDelays:
        """Delays [s] of all shots with further ones (columns,) of every event, in standard deviations."""
        moves = [self.sigma * np.clip(of_event, -MOST_SIGMAS, MOST_SIGMAS) for of_event in delays]
        pairs = zip(self.nominal_delays, moves, strict=True)
        return [nominal + move[: nominal.size].reshape(-1, 2) for nominal, move in pairs]

    def _derivatives(self, run: Run, here: Vector, shots: ShotDelays) -> Vector:
        moved = [run(later)[0] - here for later in a_step_later(shots)]
        return np.asarray(np.column_stack(moved)[self._counted] / DELAY_STEP)


def a_step_later(shots: ShotDelays) -> list[ShotDelays]:
    """The delays of shots, each time with one delay of every event longer by `DELAY_STEP`: column after column."""
    columns = range(max((delays.size for delays in shots), default=0))
    numbers = [np.arange(of_event.size).reshape(-1, 2) for of_event in shots]
    return [[one + DELAY_STEP * (column == n) for one, n in zip(shots, numbers, strict=True)] for column in columns]


def likelier_delays(z: Vector, delays: Sequence[Vector], moved: Vector, bounds: Bounds) -> list[Vector]:
    """Delays (columns,) of the shots of every event, in standard deviations, by innovations at others (n,)."""
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
