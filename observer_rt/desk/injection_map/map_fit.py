"""Fit of nozzle, back pressure and needle to a map of masses, by the package's own simulation of every point.

Numbers that the map does not determine stay near the file's, with intervals that say so.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from observer_rt.desk.injection_map.mass_map import MassMap
from observer_rt.desk.injection_map.simulated_masses import masses_of
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, Floats
from observer_rt.identification.fit import forms
from observer_rt.identification.fit.problem import UNDETERMINED_SHARE
from observer_rt.identification.likelihood import bounded_fit
from observer_rt.model.parameters import InjectorParameters

BACK_PRESSURE = forms.FreeParameter("p_C", "chamber", "pressure", "MPa", MEGAPASCAL, 0.0, 30e6, 5e6, 3.0, MEGAPASCAL)
FEWEST_POINTS = 4  # of a map
OTHER_PRESSURE = 1.3  # largest over smallest rail pressure, from which on a map tells of laws of the pressure
CLOSING_STARTS = (1.0, 0.4, 2.0)  # of the file's closing delay, from which fits may begin
STEP = 1e-3  # of a finite difference, on a parameter's scale
ROUGH = 8  # iterations before the spread of the map is known
MAD = 1.4826  # standard deviation of a normal distribution over its median of absolute values
EXPECTED = 10  # linearisations of a fit, by which its progress is told
OPENING_DELAY, _, CLOSING_DELAY, _ = MOTION = forms.ANY_NEEDLE


@dataclass(frozen=True, eq=False)
class MapFit:
    """A fit to a map: `file` before it, `injector` after it, masses (n,) [kg] by it, sigmas (p,) of `free`.

    spread: variance of the differences over that of the map, by their median, 1 at least; it is in the covariance.
    """

    map: MassMap
    file: InjectorParameters
    injector: InjectorParameters
    free: tuple[forms.FreeParameter, ...]
    masses: Floats
    covariance: Floats  # (p, p) on the parameters' scales
    spread: float

    @property
    def sigmas(self) -> Floats:
        """Standard deviations (p,) of the numbers on their scales."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def sizes(self) -> dict[str, forms.FittedNumber]:
        """The fitted numbers by name."""
        return forms.sizes_of(self.free, self.sigmas, self.file, self.injector)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of numbers that the map by itself tells little of."""
        pairs = zip(self.free, self.sigmas, strict=True)
        return tuple(parameter.name for parameter, sigma in pairs if sigma > UNDETERMINED_SHARE * parameter.spread)

    @property
    def off(self) -> Floats:
        """Masses (n,) less the measured ones, in standard deviations of the map."""
        return (self.masses - self.map.mass) / self.map.sigma

    @property
    def rms(self) -> float:
        """Share by which masses are off, rms, weighed by the map's standard deviations."""
        return math.sqrt(float(np.sum(self.off**2)) / float(np.sum((self.map.mass / self.map.sigma) ** 2)))

    @property
    def written(self) -> tuple[forms.FreeParameter, ...]:
        """Parameters that its file states anew: the fitted ones, and the map's back pressure."""
        return self.free if self.map.back_pressure is None else (BACK_PRESSURE, *self.free)

    @property
    def delay_difference(self) -> forms.FittedNumber:
        """Closing delay less opening delay at 100 MPa, which masses tell although they hardly tell either."""
        delays = (CLOSING_DELAY, OPENING_DELAY)
        closes, opens = forms.values_of(self.injector, delays)
        slopes = np.zeros(len(self.free))
        slopes[[self.free.index(delay) for delay in delays]] = closes, -opens  # by logarithms
        half = bounded_fit.NORMAL_975 * math.sqrt(slopes @ self.covariance @ slopes)
        low, value, high = np.array([-half, 0.0, half]) / MICROSECOND + (closes - opens) / MICROSECOND
        before = float(np.subtract(*forms.values_of(self.file, delays))) / MICROSECOND
        return forms.FittedNumber("t_c - t_o", float(value), (float(low), float(high)), before, "us")


@dataclass(frozen=True, eq=False)
class _MapProblem:
    """Residuals by theta (p,): of the map, and of what the file says of the free parameters."""

    file: InjectorParameters
    map: MassMap
    free: tuple[forms.FreeParameter, ...]

    @property
    def centre(self) -> Floats:
        """Theta (p,) of the file."""
        return np.array([one.theta_of(one.of(self.file)) for one in self.free])

    def starts(self) -> Iterator[Floats]:
        """Theta from which a search may begin."""
        for factor in CLOSING_STARTS:
            start = self.centre
            start[self.free.index(CLOSING_DELAY)] += np.log(factor)
            yield start

    def injector(self, theta: Floats) -> InjectorParameters:
        """The injector at theta."""
        values = [one.value_of(float(place)) for one, place in zip(self.free, theta, strict=True)]
        return forms.with_values(self.file, self.free, np.array(values))

    def masses(self, theta: Floats) -> Floats:
        """Masses (n,) [kg] at theta."""
        return masses_of(self.injector(theta), self.map.rail_pressure, self.map.energizing)

    def residuals(self, theta: Floats) -> bounded_fit.Residuals:
        """Masses less those of the map, and theta less the file's, in standard deviations."""
        z = (self.masses(theta) - self.map.mass) / self.map.sigma
        prior = (theta - self.centre) / np.array([one.spread for one in self.free])
        return bounded_fit.Residuals.of([(z, 0.0), (prior, 0.0)])

    def fitted(
        self, start: Floats, step: Callable[[], None], most: int = bounded_fit.MAX_ITERATIONS
    ) -> bounded_fit.Minimum:
        """The minimum from a start. Raises `RunError` without one."""

        def residuals(theta: Floats) -> bounded_fit.Residuals:
            step()
            return self.residuals(theta)

        ranges = [bounded_fit.Range(one.theta_of(one.lowest), one.theta_of(one.highest), STEP) for one in self.free]
        minimum = bounded_fit.fit(residuals, start, ranges, most)
        if minimum is None or not np.isfinite(minimum.statistic):
            raise RunError("the file's injector has no solution", "correct its geometry: observer-rt check --model")
        return minimum


def fit_map(file: InjectorParameters, of: MassMap, progress: Callable[[float], None]) -> MapFit:
    """Fits an injector file to a map. Raises `RunError` where the file's injector has no solution."""
    if of.back_pressure is not None:
        file = forms.with_values(file, [BACK_PRESSURE], np.array([of.back_pressure]))
    pressures = of.rail_pressure
    differ = pressures.max() > OTHER_PRESSURE * pressures.min()
    is_free = differ and of.back_pressure is None
    free = (forms.NOZZLE, *([BACK_PRESSURE] if is_free else []), *MOTION, *([forms.DELAY_EXPONENT] if differ else []))
    done = count()
    most = (len(free) + 2) * EXPECTED

    def step() -> None:
        progress(min(next(done) / most, 0.99))

    problem = _MapProblem(file, of, free)
    first = problem.fitted(min(problem.starts(), key=lambda theta: problem.residuals(theta).statistic), step, ROUGH)
    spread = _spread(first.residuals.z[: of.mass.size], len(free))
    problem = replace(problem, map=replace(of, sigma=math.sqrt(spread) * of.sigma))
    best = problem.fitted(first.theta, step)
    injector = problem.injector(best.theta)
    covariance = np.asarray(np.linalg.inv(best.at.information), np.float64)
    return MapFit(of, file, injector, free, problem.masses(best.theta), covariance, spread)


def _spread(left: Floats, parameters: int) -> float:
    """Variance of normalised differences (n,) that few outliers do not change, 1 at least."""
    return max(1.0, (left.size / max(left.size - parameters, 1)) * (MAD * float(np.median(np.abs(left)))) ** 2)
