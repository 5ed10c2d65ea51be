"""What a search ends with: the explanations that are left, with their probabilities."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from observer_rt.identification.discovery.search.results import Candidate
from observer_rt.model.effect import Likeness

TEMPER = 2.0  # of -2 log L, for what no model knows of noise and line: 12 behind are odds of 1 to 20
HIGHEST = 0.96  # of all candidates, the rest for what none of them is: of 43 that stood alone 3 were wrong
SURE = 0.95  # probability from which on a name is an answer, and that the explanations left together hold


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """Result of the search.

    winner: the best without a law, the nominal model when no name is accepted; posterior: probabilities of all
    candidates that explain the recordings, the best first; nearest: without any, the best, and those of
    other equations that explain as much; fitted: all candidates; threshold: the gain an effect had to exceed; ratio:
    of the winner's worst phase to its limit, above 1 when the winner does not explain the recordings, not even with
    an effect too small to matter.
    """

    nominal: Candidate
    winner: Candidate
    posterior: tuple[tuple[Candidate, float], ...]
    nearest: tuple[Candidate, ...]
    fitted: tuple[Candidate, ...]
    threshold: float
    ratio: float

    @property
    def adequate(self) -> bool:
        """Whether the winner explains the recordings."""
        return self.ratio <= 1.0

    @property
    def soft(self) -> bool:
        """Whether two effects were named together that are so alike that they may be one."""
        pairs = combinations(self.winner.hypothesis.effects, 2)
        return any(one.is_like(other, Likeness.ALIKE) for one, other in pairs)

    @property
    def left(self) -> tuple[Candidate, ...]:
        """The fewest explanations that together are as good as sure, the most probable first."""
        candidates, sum_of = list[Candidate](), 0.0
        for candidate, probability in self.posterior:
            if sum_of >= SURE * HIGHEST:
                break
            candidates.append(candidate)
            sum_of += probability
        return tuple(candidates)

    def probability(self, candidate: Candidate) -> float:
        """Probability of an explanation; 0 for other candidates."""
        return next((odds for other, odds in self.posterior if other.key == candidate.key), 0.0)


def probabilities(behind: Sequence[float]) -> list[float]:
    """Probabilities of explanations that are behind the best by these amounts of -2 log L, their prices in it."""
    weights = [math.exp(min(0.0, -one / (2.0 * TEMPER))) for one in behind]
    return [HIGHEST * weight / sum(weights) for weight in weights]
