"""Injections as they might have been reported."""

from typing import Any

import numpy as np

from observer_rt.estimation.scalars import SCALARS
from observer_rt.observer.learning.indicators import Estimate
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.reports.injection_report import CommandedOpening, InjectionReport


def some_report(number: int = 1, **changes: Any) -> InjectionReport:
    """The injection of a number, in SI units, with everything known that can be known unless changed."""
    content: dict[str, Any] = {
        "number": number,
        "event": number,
        "start": 1000 * number,
        "end": 1000 * number + 100,
        "start_index": 5000 + 1000 * number,
        "end_index": 5000 + 1000 * number + 100,
        "volume": 50e-9,
        "mass": 41.5e-6 + number * 1e-9,
        "mass_ci95": (41.0e-6, 42.0e-6),
        "rate_sigma": np.full(101, 1e-7),
        "peak_rate": 69e-6,
        "rail_pressure": 120e6,
        "valid": True,
        "reason": Reason.NONE,
        "state": State.ADAPTED,
        "phi_version": number,
        "indicators": {shown.effect: Estimate(0.3, 0.01) for _, shown in SCALARS.shown()},
        "density": 830.0,
        "fuel_temperature": 313.15,
        "commanded": CommandedOpening(number, 320e-6, 1.1e-3),
    }
    return InjectionReport(**(content | changes))
