"""How sure a verdict is: -2 log L differences, tempered so that what is said with 90 % is right in 90 %."""

import math
from collections.abc import Sequence

from observer_rt.discovery.search.result import Candidate
from observer_rt.discovery.search.search import SearchOutcome, price

METHOD = (
    "share of exp(-X/(2 T)) among candidates of the same size that might be right, X = -2 log L + 10 a parameter, "
    "T = 2 for what no model knows of noise and line; at most 0.99"
)
TEMPER = 2.0
HIGHEST = 0.99
WITH_A_WRONG_MODEL = 0.8  # at most, when discovery names something on healthy recordings


def confidence_of(found: SearchOutcome) -> float:
    """Probability that the winner is right; of the nominal model, that nothing is missing."""
    if not found.adequate:
        return HIGHEST * (1.0 - 0.5 / found.ratio)
    handicap = 0.0 if found.winner.hypothesis.effects else found.threshold  # of those who would be accepted
    return HIGHEST * _share(found.winner, [*found.contenders, found.nominal], handicap)


def _share(winner: Candidate, others: Sequence[Candidate], handicap: float) -> float:
    weights = [
        math.exp(min(0.0, -(price(one) + handicap - price(winner)) / (2.0 * TEMPER)))
        for one in others
        if one is not winner
    ]
    return 1.0 / (1.0 + sum(weights))
