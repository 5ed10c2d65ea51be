"""How well a share is known from a count."""

from scipy.stats import beta

CONFIDENCE = 0.99


def clopper_pearson(successes: int, trials: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Interval of a probability from its count of successes."""
    tail = 0.5 * (1.0 - confidence)
    low = beta.ppf(tail, successes, trials - successes + 1) if successes > 0 else 0.0
    high = beta.ppf(1.0 - tail, successes + 1, trials - successes) if successes < trials else 1.0
    return float(low), float(high)
