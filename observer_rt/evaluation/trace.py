"""What the observer says at every sample."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.observer.stream.state import State

Signal = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """The observer at every sample of a recording (n samples); nan where not available.

    injection_rate [m3/s]; injection_rate_sigma [m3/s]: its standard deviation over the windows of injections that
    were learned from; state: `State`; x normalised (n, 3); phi [1/s] (n, 3); nominal_rate [m3/s]: the model
    with phi = 0 on the same frames.
    """

    injection_rate: Signal
    injection_rate_sigma: Signal
    valid: NDArray[np.bool_]
    state: NDArray[np.int8]
    x: Signal
    phi: Signal
    nominal_rate: Signal

    @classmethod
    def unavailable(cls, samples: int, state: State) -> Self:
        """The observer in one state, nothing available."""
        rate, sigma, nominal = np.full((3, samples), np.nan)
        x, phi = np.full((2, samples, 3), np.nan)
        return cls(
            rate, sigma, np.zeros(samples, np.bool_), np.full(samples, state, np.int8), x, phi, nominal
        )


def joined(traces: Sequence[Trace]) -> Trace:
    """One after another, in memory of its own."""
    return Trace(*(np.concatenate([getattr(trace, each.name) for trace in traces]) for each in fields(Trace)))
