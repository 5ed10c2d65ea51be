"""What the service says of one injection, in SI units."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.observer.indicators import Indicators
from observer_rt.observer.state import Reason, State


@dataclass(frozen=True, eq=False)
class InjectionReport:
    """One injection, judged with its event.

    start, end are positions in the stream of samples, the indices those of the device. `volume` [m3], `mass`
    [kg] and `peak_rate` [m3/s] are nan when some sample had no rate; `mass_ci95` [kg] is
    known once its event was learned from, as is `rate_sigma` (n,) [m3/s], the standard deviation of the published
    rate at the n samples from start to end; `rail_pressure` [Pa] at the opening.
    """

    number: int
    event: int
    start: int
    end: int
    start_index: int
    end_index: int
    volume: float
    mass: float
    mass_ci95: tuple[float, float] | None
    rate_sigma: NDArray[np.float64] | None
    peak_rate: float
    rail_pressure: float
    valid: bool
    reason: Reason
    state: State
    phi_version: int
    indicators: Indicators
