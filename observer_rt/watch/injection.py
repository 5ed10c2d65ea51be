"""An injection as it was seen on the bus."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.output_messages import SummaryValues

Signal = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SampleCurves:
    """Its samples, (n,): time since the first [ms]; nan where nothing came.

    rail_pressure, line_pressure [MPa]; needle_lift [um]; rate [mm3/ms] as published, nominal by the model as given;
    phi (3, n) [1/s], of the wear as published.
    """

    time: Signal
    rail_pressure: Signal
    needle_lift: Signal
    line_pressure: Signal
    rate: Signal
    nominal: Signal
    phi: Signal


@dataclass(frozen=True, eq=False)
class SeenInjection:
    """An injection: its summary as published, when that came [ns since 1970], and its samples.

    nominal_mass [mg]: by the model as given, nan where that is not known.
    """

    summary: SummaryValues
    moment: int
    curves: SampleCurves
    nominal_mass: float

    @property
    def band(self) -> Signal:
        """Half the 95 % band of its rate [mm3/ms], (n,): the rate is as sure as the mass."""
        share = 1.96 * self.summary.mass_sigma / self.summary.mass if self.summary.mass else np.nan
        return (np.abs(self.curves.rate) * share).astype(np.float32)
