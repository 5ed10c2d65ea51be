"""The model without correction along an observer's samples, and along one injection as a reference for it."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from observer_rt.config.bench import BenchInjector
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import Terms
from observer_rt.core.stream.stream import RING, Break
from observer_rt.engine.estimation.parameters import nothing_learned
from observer_rt.engine.estimation.predictor import NO_COMMANDS, NO_SLOPES, Setting, Window
from observer_rt.engine.observer import commands_at, remembered
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.injector import bench_constants
from observer_rt.engine.stream.state import Constants, Observer
from observer_rt.foundation.units import Floats, Structs
from observer_rt.model.effective import NO_CLOCK, Clock, Coefficients


class Follower:
    """x^ without correction, from a state on; the measured line pressure does not matter."""

    def __init__(self, constants: Constants) -> None:
        self.constants = constants
        """Constants in force from the next block on."""
        self.begin(np.full(constants.coefficients.states, np.nan))

    def begin(self, x: Floats, clock: Clock = NO_CLOCK) -> None:
        """Be in a state x (states,) at a sample, at which the clock of the terms shows this."""
        self._x, self._terms = x, Terms(self.constants.program, *clock)

    def along(self, rows: Structs, commands: Floats = NO_COMMANDS) -> Floats:
        """Injection rate (n,) [m3/s] at rows (n,), 0 at the first, which has the state; commands: as of `Window`."""
        constants, c = self.constants, self.constants.coefficients
        errors, rate = np.empty((2, len(rows)))
        setting = Setting(constants.interval, constants.substeps, c, np.zeros(c.states), program=constants.program)
        window = Window(
            inputs=np.column_stack([rows["rail_pressure"], rows["seat_area"]]),
            output=np.zeros(len(rows)),
            resting=rows["resting"].copy(),
            start=np.append(self._x, self._x[0]),
            opening=0,
            knots=np.column_stack([rows["lift_after"], rows["lift_area"]]),
            commands=commands,
        )
        self._x = follow(window, setting, nothing_learned(c), 0, errors, rate, None, NO_SLOPES, self._terms)
        return rate


class NominalModel:
    """The model without correction along an observer's samples; it begins anew from x~ where the observer does."""

    def __init__(self, constants: Constants) -> None:
        self._follower = Follower(constants)
        self._end = self._injections = 0

    def rates(self, observer: Observer, first: int, end: int) -> Floats:
        """Rates [m3/s] at positions [first, end), processed and remembered; nan where the observer has none."""
        if first != self._end:
            self._follower.begin(np.full(observer.constants.coefficients.states, np.nan))
        self._follower.constants, self._end = observer.constants, end  # in the surroundings of these samples
        before = max(first - 1, 0)
        rows = remembered(observer.ring, before, end)
        rates, is_open = np.zeros(len(rows)), rows["seat_area"] > 0.0
        openings = self._injections + np.cumsum(np.diff(is_open, prepend=is_open[:1]) & is_open)
        runs = ~(rows["resting"] | (rows["broken"] != Break.NONE))  # elsewhere x^ is x~
        for start, stop in np.flatnonzero(np.diff(runs, prepend=False, append=False)).reshape(-1, 2).tolist():
            from_row = max(start - 1, 0)
            if start > 0:
                position = before + from_row
                clock = Clock(position * observer.constants.interval, float(openings[from_row]))
                self._follower.begin(observer.x_tilde[position % RING], clock)
            commands = commands_at(observer, before + from_row, before + stop)
            rates[from_row:stop] = self._follower.along(rows[from_row:stop], commands)
        self._injections = int(openings[-1])
        return np.where(np.isnan(rows["injection_rate"]), np.nan, rates)[first - before :]


class ComparedRate(NamedTuple):
    """Reference of an injection: its rate [m3/s] over the injection's samples, and its mass [kg]."""

    name: str
    rate: Floats
    mass: float


References = Callable[[InjectionReport, Structs], Sequence[ComparedRate]]
"""References for an injection and its samples, dtype `stream.state.sample_dtype`."""


class NominalInjection:
    """The model as given, run over an injection's own inputs."""

    def __init__(self, injector: BenchInjector) -> None:
        self._constants = bench_constants(injector)
        self.coefficients: Coefficients = self._constants.coefficients

    def __call__(self, report: InjectionReport, rows: Structs) -> Sequence[ComparedRate]:
        """Rate and mass of the injection; none where the needle was open from the start."""
        is_open = rows["seat_area"] > 0.0
        if not is_open.any() or is_open[0]:
            return ()
        follower = Follower(self._constants)
        follower.begin(rows["x_tilde"][0])
        rate = follower.along(rows)
        mass = float(np.trapezoid(rate)) * self._constants.interval * report.density
        return [ComparedRate("nominal", rate, mass)]
