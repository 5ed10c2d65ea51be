"""The model as given, run over an injection's own inputs: what an injection is compared with."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.constants import bench_constants
from observer_rt.engine.stream.follower import Follower
from observer_rt.model.effective import Coefficients


@dataclass(frozen=True)
class ComparedRate:
    """Reference of an injection: its rate [m3/s] over the injection's samples, and its mass [kg]."""

    name: str
    rate: NDArray[np.float64]
    mass: float


References = Callable[[InjectionReport, NDArray[np.void]], Sequence[ComparedRate]]
"""References for an injection and its samples, dtype `stream.state.sample_dtype`."""


class NominalInjection:
    """The model as given, run over an injection's own inputs."""

    def __init__(self, fitted: BenchInjector) -> None:
        self._constants = bench_constants(fitted)
        self.coefficients: Coefficients = self._constants.coefficients

    def __call__(self, report: InjectionReport, rows: NDArray[np.void]) -> Sequence[ComparedRate]:
        """Rate and mass of the injection; none where the needle was open from the start."""
        is_open = rows["seat_area"] > 0.0
        if not is_open.any() or is_open[0]:
            return ()
        follower = Follower(self._constants)
        follower.begin(rows["x_tilde"][0])
        rate = follower.along(rows)
        mass = float(np.trapezoid(rate)) * self._constants.interval * report.density
        return [ComparedRate("nominal", rate, mass)]
