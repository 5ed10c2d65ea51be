"""Candidates judged on operating points that they were not fitted to."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import robust_cost
from observer_rt.identification.discovery.search.candidates import Candidate, CandidateKey, sizing
from observer_rt.identification.likelihood.bounded_fit import fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel, RecordingLikelihood
from observer_rt.identification.likelihood.open_loop import pressure_gap, simulated
from observer_rt.identification.likelihood.operating_points import every_second_point
from observer_rt.model.effective import EffectiveModel


class HeldOutPoints:
    """Candidates fitted to every second operating point and judged on the events of the others."""

    def __init__(self, likelihood: JointLikelihood, nominal: EffectiveModel) -> None:
        recordings = likelihood.recordings
        halves = every_second_point([recorded.measurement for recorded in recordings])
        self._fitted, self._judged = (JointLikelihood([recordings[i] for i in half]) for half in halves)
        self._nominal = nominal
        self._cache: dict[CandidateKey, _Events | None] = {}

    def statistic(self, candidate: Candidate) -> float:
        """-2 log L of all events held out; inf without a solution, nan if nothing is held out."""
        if not self._judged.recordings:
            return math.nan
        events = self._events(candidate)
        return math.inf if events is None else float(np.sum(events.statistic))

    def sizes(self, candidate: Candidate) -> tuple[float, ...]:
        """Sizes fitted to every second operating point; to all points if nothing is held out."""
        events = self._events(candidate) if self._judged.recordings else None
        return candidate.sizes if events is None else tuple(events.theta.tolist())

    def gap(self, candidate: Candidate) -> float:
        """Rms of the line pressure's open-loop gap on the events held out [Pa]; nan without any."""
        if not self._judged.recordings:
            return math.nan
        events = self._events(candidate)
        return math.inf if events is None else math.sqrt(float(np.mean(events.gap)))

    def pays(self, candidate: Candidate, smaller: Candidate) -> bool:
        """Whether a candidate explains the events held out better than a smaller one; true if nothing is held out.

        -2 log L must fall by more than its fall scatters between events. The open-loop gap of the line pressure may
        grow by its scatter at most: it shows small effects less clearly, but users want a model with a small gap.
        """
        if not self._judged.recordings:
            return True
        after, before = self._events(candidate), self._events(smaller)
        if after is None or before is None:
            return before is None and after is not None
        fall, scatter = _sum_with_scatter(before.statistic - after.statistic)
        gap_fall, gap_scatter = _sum_with_scatter(before.gap - after.gap)
        return fall > scatter and gap_fall > -gap_scatter

    def _events(self, candidate: Candidate) -> "_Events | None":
        if candidate.key not in self._cache:
            self._cache[candidate.key] = self._judge(candidate)
        return self._cache[candidate.key]

    def _judge(self, candidate: Candidate) -> "_Events | None":
        hypothesis, theta = candidate.hypothesis, candidate.theta
        if hypothesis.effects:
            refitted = fit(sizing(self._fitted, self._nominal, hypothesis), theta, hypothesis.ranges())
            if refitted is None:
                return None
            theta = refitted.theta
        model = hypothesis.model(self._nominal, theta)
        judged = self._judged.judge(model)
        if judged is None:
            return None
        recordings = self._judged.recordings
        statistic = [_statistic_by_event(*pair) for pair in zip(recordings, judged, strict=True)]
        measured = [recorded.measurement for recorded in recordings]
        gap = [float(np.mean(pressure_gap(one, run) ** 2)) for one in measured for run in simulated(one, model)]
        return _Events(theta, np.concatenate(statistic), np.array(gap))


@dataclass(frozen=True, eq=False)
class _Events:
    """Events held out."""

    theta: NDArray[np.float64]  # (p,) fitted to the other events
    statistic: NDArray[np.float64]  # (events,) -2 log L
    gap: NDArray[np.float64]  # (events,) mean square of the line pressure's open-loop gap [Pa2]


def _sum_with_scatter(values: NDArray[np.float64]) -> tuple[float, float]:
    """Sum of values (events,), and its standard deviation by their scatter, which is 0 for a single event."""
    scatter = float(np.std(values, ddof=1)) * math.sqrt(values.size) if values.size > 1 else 0.0
    return float(np.sum(values)), scatter


def _statistic_by_event(recorded: RecordingLikelihood, judged_model: JudgedModel) -> NDArray[np.float64]:
    """-2 log L of the events of a recording (events,); the part of a measured rate is divided among them evenly."""
    sizes = np.array([event.end - event.counted for event in recorded.measurement.events])
    beyond = np.array([2.0 * robust_cost(judged_model.z, first, 1.0) for first in [0, *np.cumsum(sizes).tolist()]])
    of_rate = robust_cost(judged_model.rate_z, 0, 1.0) + judged_model.rate_z.size * judged_model.rate_log_sigma
    return np.asarray(beyond[:-1] - beyond[1:] + 2.0 * sizes * judged_model.log_sigma + 2.0 * of_rate / sizes.size)
