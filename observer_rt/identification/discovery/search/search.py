"""The search for the missing effect: singles, pairs, and the verdict; judged on operating points left out, too."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import robust_cost
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.identification.discovery.search.adequacy import worst
from observer_rt.identification.discovery.search.candidates import NEAR, Fitter, best_of_each
from observer_rt.identification.discovery.search.hypothesis import Sizing
from observer_rt.identification.discovery.search.results import Candidate
from observer_rt.identification.likelihood.appearance import least_gain
from observer_rt.identification.likelihood.bounded_fit import fit
from observer_rt.identification.likelihood.likelihood import (
    JointLikelihood,
    JudgedModel,
    RecordingLikelihood,
    pool_of,
)
from observer_rt.identification.likelihood.measurement import Measurement, every_second_point
from observer_rt.identification.likelihood.open_loop import simulated
from observer_rt.model.effect import Effect, Likeness
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY

RELATIVE_GAIN = 1e-3  # of what is explained, that one more effect must add to an adequate model
TIE = 16.0  # of -2 log L within which a rival explains the recordings as well
LEADERS = 3  # singles that a second effect is added to
PARAMETER_PRICE = 10.0  # of -2 log L for each parameter more, log(n): which of two near-ties leads


class HeldOutPoints:
    """Candidates fitted to every second operating point and judged on the events of the others."""

    def __init__(self, likelihood: JointLikelihood, nominal: EffectiveModel) -> None:
        first, second = every_second_point([recorded.measurement for recorded in likelihood.recordings])
        self._fitted, self._judged = (
            JointLikelihood([likelihood.recordings[i] for i in part]) for part in (first, second)
        )
        self._nominal = nominal
        self._known: dict[tuple[tuple[str, ...], tuple[float, ...]], _Events | None] = {}

    def statistic(self, candidate: Candidate) -> float:
        """-2 log L of all events held out; inf without a solution, nan where there is nothing to hold out."""
        if not self._judged.recordings:
            return math.nan
        events = self._events(candidate)
        return math.inf if events is None else float(np.sum(events.statistic))

    def gap(self, candidate: Candidate) -> float:
        """Rms of the line pressure's open-loop gap on the events held out [Pa]; nan without any."""
        if not self._judged.recordings:
            return math.nan
        events = self._events(candidate)
        return math.inf if events is None else math.sqrt(float(np.mean(events.gap)))

    def pays(self, candidate: Candidate, smaller: Candidate) -> bool:
        """Whether a candidate explains the events held out better than a smaller one.

        -2 log L must fall by more than that scatters between events. The gap of the line pressure, with nothing
        corrected from the opening on, must not grow by more than it scatters: it says less of a small effect, but it
        is what a model is wanted for. Where nothing can be held out nothing speaks against a candidate.
        """
        if not self._judged.recordings:
            return True
        after, before = self._events(candidate), self._events(smaller)
        if after is None or before is None:
            return before is None and after is not None
        falls, scatter = _total(before.statistic - after.statistic)
        shrinks, gap_scatter = _total(before.gap - after.gap)
        return falls > scatter and shrinks > -gap_scatter

    def _events(self, candidate: Candidate) -> "_Events | None":
        key = (candidate.ids, candidate.sizes)
        if key not in self._known:
            self._known[key] = self._found(candidate)
        return self._known[key]

    def _found(self, candidate: Candidate) -> "_Events | None":
        hypothesis, theta = candidate.hypothesis, candidate.theta
        if hypothesis.effects:
            again = fit(Sizing(self._fitted, self._nominal, hypothesis), theta, hypothesis.ranges())
            if again is None:
                return None
            theta = again.theta
        model = hypothesis.model(self._nominal, theta)
        judged = self._judged.judge(model)
        if judged is None:
            return None
        recordings = self._judged.recordings
        statistic = [_by_event(recorded, one) for recorded, one in zip(recordings, judged, strict=True)]
        gap = [_gap_by_event(recorded.measurement, model) for recorded in recordings]
        return _Events(np.concatenate(statistic), np.concatenate(gap))


@dataclass(frozen=True, eq=False)
class _Events:
    """Events held out (events,): -2 log L, and the mean square of the open-loop gap of the line pressure."""

    statistic: NDArray[np.float64]
    gap: NDArray[np.float64]


def _total(falls: NDArray[np.float64]) -> tuple[float, float]:
    """The sum over events (events,), and its standard deviation as the events scatter; 0 with one."""
    scatter = float(np.std(falls, ddof=1)) * math.sqrt(falls.size) if falls.size > 1 else 0.0
    return float(np.sum(falls)), scatter


def _gap_by_event(measurement: Measurement, model: EffectiveModel) -> NDArray[np.float64]:
    line = measurement.recording.line_pressure
    runs = simulated(measurement, model)
    return np.array([float(np.mean((one.line_pressure - line[one.samples]) ** 2)) for one in runs])


def _by_event(recorded: RecordingLikelihood, one: JudgedModel) -> NDArray[np.float64]:
    """-2 log L of the events of a recording (events,); its measured rate is shared out evenly."""
    events: Sequence[int] = [event.end - event.counted for event in recorded.measurement.events]
    ends = np.cumsum(events)
    rate = 2.0 * (robust_cost(one.rate_z, 0, 1.0) + one.rate_z.size * one.rate_log_sigma) / len(events)
    return np.array(
        [
            2.0 * robust_cost(one.z, int(end - size), 1.0)
            - 2.0 * robust_cost(one.z, int(end), 1.0)
            + 2.0 * size * one.log_sigma
            + rate
            for size, end in zip(events, ends, strict=True)
        ]
    )


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """Result of the search. winner: the nominal model when nothing is accepted; rivals: as many effects, as good.

    ratio: of the winner's worst phase to its limit, above 1 when the winner does not explain the recordings;
    contenders: candidates of the winner's size that might be right instead; fitted: all candidates; threshold: the
    gain an effect had to exceed; too_small: an effect within its dead zone explains what is left.
    """

    nominal: Candidate
    winner: Candidate
    rivals: tuple[Candidate, ...]
    contenders: tuple[Candidate, ...]
    fitted: tuple[Candidate, ...]
    threshold: float
    ratio: float
    too_small: bool

    @property
    def adequate(self) -> bool:
        """Whether the winner explains the recordings, or would with an effect too small to matter."""
        return self.ratio <= 1.0 or self.too_small

    @property
    def soft(self) -> bool:
        """Whether two effects were named together that are so alike that they may be one."""
        pairs = combinations(self.winner.hypothesis.effects, 2)
        return any(one.is_like(other, Likeness.ALIKE) for one, other in pairs)


def representatives() -> tuple[Effect, ...]:
    """The vocabulary with one effect of every class that no recording can tell apart."""
    chosen: list[Effect] = []
    for effect in VOCABULARY.values():
        if not any(effect.is_like(other, Likeness.SAME) for other in chosen):
            chosen.append(effect)
    return tuple(chosen)


def indistinguishable(effect: Effect) -> tuple[str, ...]:
    """Ids of the effects no recording can tell from this one."""
    return tuple(other.id for other in VOCABULARY.values() if effect.is_like(other, Likeness.SAME))


class Search:
    """Singles, then pairs where something is left to explain."""

    def __init__(self, fitter: Fitter, effects: Sequence[Effect], baseline: Healthy = NOT_FITTED) -> None:
        self._fitter = fitter
        self._effects = effects
        self._baseline = baseline
        self._least_gain = least_gain(baseline.appears)
        self.held_out = HeldOutPoints(fitter.likelihood, fitter.nominal)

    def run(self) -> SearchOutcome:
        """Fit candidates until nothing more is worth adding; see `SearchOutcome`."""
        nominal = self._fitter.nothing()
        singles = sorted(self._fitter.singles(self._effects, nominal), key=price)
        best, threshold, ratio = nominal, self._threshold(nominal), self._ratio(nominal)
        single = self._best(singles, nominal, best, ratio)
        if single is not None:
            best, ratio = single, self._ratio(single)
            threshold = self._threshold(best)
        pairs = self._pairs(singles, best, ratio)
        pair = self._best(pairs, nominal, best, ratio, singles)
        if pair is not None:
            best, ratio = pair, self._ratio(pair)
            threshold = self._threshold(best)
        fitted = (nominal, *singles, *pairs)
        too_small = ratio > 1.0 and best is nominal and self._is_too_small(singles[0])
        contenders = self._contenders(best, fitted, threshold)
        return SearchOutcome(
            nominal, best, self._rivals(best, fitted), contenders, fitted, threshold, ratio, too_small
        )

    def _contenders(
        self, winner: Candidate, fitted: Sequence[Candidate], threshold: float
    ) -> tuple[Candidate, ...]:
        """Candidates that might be right instead, of the same size (single effects beside the nominal model)."""
        size = max(1, len(winner.hypothesis.effects))
        limit = price(winner) + NEAR + (0.0 if winner.hypothesis.effects else threshold)
        return tuple(
            one
            for one in fitted
            if one is not winner
            and len(one.hypothesis.effects) == size
            and one.plausible
            and price(one) < limit
            and self._is_new(one)
        )

    def _is_too_small(self, single: Candidate) -> bool:
        """Whether a single explains the recordings by an effect within its dead zone."""
        return single.within_bounds and not single.plausible and self._ratio(single) <= 1.0

    def _pairs(self, singles: Sequence[Candidate], best: Candidate, ratio: float) -> list[Candidate]:
        """Pairs worth fitting: with the best single, with more leaders when it does not explain the recordings.

        Where a pair is worth having, its other member leads, too: the best single may stand in for two.
        """
        if not best.hypothesis.effects and ratio <= 1.0:
            return []
        leaders = list(singles[: 1 if ratio <= 1.0 else LEADERS])
        pairs = best_of_each(self._fitter.pairs(leaders, self._effects), price)
        partners = [
            one for one in singles if pairs and set(one.ids) < set(pairs[0].ids) and one not in leaders
        ]
        if partners and pairs[0].statistic < leaders[0].statistic - self._least_gain:
            pairs = best_of_each([*pairs, *self._fitter.pairs(partners, self._effects)], price)
        return pairs

    def _best(
        self,
        candidates: Sequence[Candidate],
        nominal: Candidate,
        smaller: Candidate,
        ratio: float,
        parts: Sequence[Candidate] = (),
    ) -> Candidate | None:
        """The best candidate whose every effect is plausible and pays for itself; None: no better one.

        parts: fitted singles, of which a pair must beat each of its own.
        """
        limit = np.inf
        for candidate in candidates:
            threshold = self._threshold(candidate)
            if ratio <= 1.0:
                threshold = max(threshold, RELATIVE_GAIN * (nominal.statistic - smaller.statistic))
            own = [part for part in parts if set(part.ids) < set(candidate.ids)]
            gain = min(part.statistic for part in (smaller, *own)) - candidate.statistic
            if gain <= threshold or candidate.statistic > limit:
                continue
            if candidate.plausible:
                if self._is_new(candidate) and self.held_out.pays(
                    candidate, min((smaller, *own), key=attrgetter("statistic"))
                ):
                    return candidate
                continue
            if len(candidate.hypothesis.effects) == 1 and candidate.within_bounds:
                # too small to matter, and yet it explains better than what would follow
                limit = min(limit, candidate.statistic + TIE)
        return None

    def _rivals(self, winner: Candidate, fitted: Sequence[Candidate]) -> tuple[Candidate, ...]:
        size = len(winner.hypothesis.effects)
        return tuple(
            other
            for other in fitted
            if other is not winner
            and len(other.hypothesis.effects) == size
            and other.statistic < winner.statistic + TIE
            and other.plausible
            and self._is_new(other)
        )

    def _is_new(self, candidate: Candidate) -> bool:
        """Whether every size differs from what the effect appears to be on the healthy injector."""
        if not self._baseline.appears:
            return True
        sigmas, place = self._fitter.sigmas(candidate), 0
        for effect, values in zip(
            candidate.hypothesis.effects, candidate.hypothesis.split(candidate.theta), strict=True
        ):
            mean, sigma = self._fitter.reference(effect)
            if values.size and abs(values[0] - mean) < math.sqrt(self._least_gain) * math.hypot(
                float(sigmas[place]), sigma
            ):
                return False
            place += values.size
        return True

    def _threshold(self, candidate: Candidate) -> float:
        """Least gain of an effect beside a candidate: more, the more that leaves unexplained."""
        residuals = self._fitter.likelihood.residuals(candidate.model(self._fitter.nominal))
        if residuals is None:
            return np.inf
        return self._least_gain * max(1.0, float(np.mean(residuals.z**2)))

    def _ratio(self, candidate: Candidate) -> float:
        """Ratio of a candidate's worst phase to its limit."""
        judged = self._fitter.likelihood.judge(candidate.model(self._fitter.nominal))
        if judged is None:
            return np.inf
        return worst(pool_of(self._fitter.likelihood, judged), self._baseline).ratio


def price(candidate: Candidate) -> float:
    """-2 log L with a price for every parameter."""
    return candidate.statistic + PARAMETER_PRICE * len(candidate.sizes)
