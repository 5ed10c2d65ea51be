"""What the view keeps of an injection."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.estimation.open_loop import open_loop
from observer_rt.estimation.predictor import Setting, Window
from observer_rt.estimation.scalars import SCALARS
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass


@dataclass(frozen=True)
class ComparedRate:
    """What an injection can be compared with: its rate [m3/s] over the injection's samples, and its mass [kg]."""

    name: str
    rate: NDArray[np.float64]
    mass: float


References = Callable[[InjectionReport, NDArray[np.void]], Sequence[ComparedRate]]
"""Of an injection and its samples, dtype `stream.state.SAMPLE`."""


@dataclass
class ShownInjection:
    """An injection, its samples, what it is compared with (None: not worked out yet), its measured mass."""

    report: InjectionReport
    rows: NDArray[np.void]
    references: Sequence[ComparedRate] | None = None
    measured: MeasuredMass | None = None


class NominalInjection:
    """The model as given, run over an injection's own inputs."""

    def __init__(self, fitted: BenchInjector) -> None:
        constants = bench_constants(fitted)
        self.coefficients: Coefficients = constants.coefficients
        self._setting = Setting(
            constants.interval,
            constants.substeps,
            constants.coefficients,
            np.zeros(constants.coefficients.states),  # it is not corrected by what is measured
        )
        self._nothing_learned = np.zeros(SCALARS.width)

    def __call__(self, report: InjectionReport, rows: NDArray[np.void]) -> Sequence[ComparedRate]:
        """Its rate and mass; none where the needle was open from the start."""
        is_open = rows["seat_area"] > 0.0
        if not is_open.any() or is_open[0]:
            return ()
        window = Window(
            inputs=np.column_stack([rows["rail_pressure"], rows["seat_area"]]),
            output=rows["line_pressure"].copy(),
            resting=rows["resting"].copy(),
            start=np.append(rows["x_tilde"][0], rows["indicated"][0]),
            opening=int(np.argmax(is_open)),
            knots=np.column_stack([rows["lift_after"], rows["lift_area"]]),
        )
        rate = open_loop(window, self._setting, self._nothing_learned).rate
        mass = float(np.trapezoid(rate)) * self._setting.interval * report.density
        return [ComparedRate("nominal", rate, mass)]
