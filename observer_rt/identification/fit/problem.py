"""The problem of a fit: residuals as a function of free parameters and offsets, and the certainty at a minimum."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from observer_rt.core.model.model import STEP
from observer_rt.foundation.units import MEGAPASCAL, Floats
from observer_rt.identification.fit.forms import STIFFENING, FreeParameter, with_values
from observer_rt.identification.fit.masses import MEAN, WeighedMasses
from observer_rt.identification.fit.suitability import standstill
from observer_rt.identification.likelihood.bounded_fit import Quadratic, Range, Residuals, sigmas_of
from observer_rt.identification.likelihood.excerpts import events_by_point
from observer_rt.identification.likelihood.likelihood import JudgedModel, RecordingLikelihood
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.wave_line import RESOLVED, STABLE

T = TypeVar("T")

RING_DOWN = 5e-3  # s after the last closing that count: the line forgets within less
OFFSET_SIGMA = 2 * MEGAPASCAL  # of the line-pressure sensor, in each recording
_DIFFERENCE_STEP = 1e-3  # of a finite difference: of the logarithm, and of an offset in MPa
_MOST_KEPT = 24  # residuals cached of a fold: those of a linearisation
GROUPS_OF_FOLD = 3  # of residuals: of the line pressure, of the rate, of the mass
UNDETERMINED_SHARE = 1.0 / 3.0  # of what was unknown before: a parameter known no better is left to the file


@dataclass(frozen=True, eq=False)
class Fold:
    """A part of the data that can be left out of a fit: a recording, or some events of the only one."""

    measurement: Measurement  # with shortened events
    recording: int  # its number
    weights: Floats  # (events,) number of injections for which each event stands
    weighed: WeighedMasses  # of its recording
    rate_shape: bool = False  # whether a measured rate counts sample by sample, and not by its integrals alone
    tempering: float = 1.0  # mean square of what pressures leave, over noise, which makes a mass count for more

    @cached_property
    def weighings(self) -> list[list[int]]:
        """Numbers of its weighed injections, those of an operating point together; or MEAN."""
        points = [[event.number for event in point] for point in events_by_point(self.measurement)]
        own = [[number for number in numbers if number in self.weighed] for numbers in ([MEAN], *points)]
        return [numbers for numbers in own if numbers]

    @cached_property
    def measured_masses(self) -> WeighedMasses:
        """Measured masses of its own injections, or their mean."""
        return {number: self.weighed[number] for numbers in self.weighings for number in numbers}

    def mass_of(self, masses: Floats, injection: int = MEAN) -> float:
        """Of masses (events,) that of an injection by its number, or the mean of all."""
        if injection == MEAN:
            return float(np.average(masses, weights=self.weights))
        return float(masses[[event.number for event in self.measurement.events].index(injection)])

    def mass_residuals(self, masses: Floats) -> Floats:
        """Modelled masses (events,) [kg] beside the k measured ones, in standard deviations (k,)."""
        off = [(self.mass_of(masses, number) - m.mass) / m.sigma for number, m in self.measured_masses.items()]
        return np.array(off) * math.sqrt(self.tempering)


def folds_of(recordings: Sequence[Measurement], weighed: Mapping[int, WeighedMasses]) -> tuple[Fold, ...]:
    """Every recording as a fold; a single one without a measured mean is divided by operating points, or halved."""
    short = []
    for recording in recordings:
        tail = round(RING_DOWN * recording.recording.sample_rate)
        events = tuple(replace(e, end=min(e.end, e.openings[-1].last + tail)) for e in recording.events)
        short.append(replace(recording, events=events))
    if len(short) > 1 or len(short[0].events) == 1 or MEAN in weighed.get(0, {}):
        groups = [(number, list(recording.events)) for number, recording in enumerate(short)]
    else:
        points = events_by_point(short[0])
        if len(points) == 1:
            half = (len(points[0]) + 1) // 2
            points = [points[0][:half], points[0][half:]]
        groups = [(0, events) for events in points]
    return tuple(
        Fold(replace(short[n], events=tuple(events)), n, np.ones(len(events)), weighed.get(n, {}))
        for n, events in groups
    )


def by_meter(fold: Fold, meter: tuple[float, ...]) -> Fold:
    """A fold whose rate has a meter of these time constants [s]."""
    recording = replace(fold.measurement.recording, meter=meter)
    return replace(fold, measurement=replace(fold.measurement, recording=recording))


def thinned(fold: Fold, most: int) -> Fold:
    """At most so many events of each operating point, spread evenly, those first that were weighed."""
    kept = []
    for point in events_by_point(fold.measurement):
        weighed = [event for event in point if event.number in fold.weighed]
        others = [event for event in point if event.number not in fold.weighed]
        chosen = spread(weighed, most) + spread(others, max(0, most - len(weighed)))
        kept += [(event, len(point) / len(chosen)) for event in chosen]
    kept.sort(key=lambda item: item[0].start)
    measurement = replace(fold.measurement, events=tuple(event for event, _ in kept))
    return replace(fold, measurement=measurement, weights=np.array([share for _, share in kept]))


def spread(items: Sequence[T], most: int) -> list[T]:
    """At most so many items, spread evenly."""
    return [items[n] for n in np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)]


class Calibration:
    """The problem of a fit: residuals by theta (p + folds,), scaled parameters, then offsets of the folds [MPa].

    A step of one offset changes the residuals of its fold alone; the others are remembered.
    """

    def __init__(self, start: InjectorParameters, free: Sequence[FreeParameter], folds: Sequence[Fold]) -> None:
        """start: the injector in the structure to be fitted, at which the prior is centred."""
        self.free = tuple(free)
        self.folds = tuple(folds)
        self._injector = start
        self.recordings = [RecordingLikelihood(fold.measurement, effective_model(start)) for fold in folds]
        """Likelihoods of the folds, in their order."""
        self._kept: list[dict[tuple[float, ...], JudgedModel | None]] = [{} for _ in folds]
        numbers = [parameter.theta_of(parameter.of(start)) for parameter in free]
        offsets = [standstill(fold.measurement)[0] / MEGAPASCAL for fold in folds]
        self.centre = np.concatenate([numbers, offsets])  # (p + folds,) where a search begins
        usual = [one.theta_of(one.start) if one.linear else theta for one, theta in zip(free, numbers, strict=True)]
        self.prior_mean = np.concatenate([usual, offsets])
        """The same, but for parameters on a linear scale their usual values."""

    @property
    def prior_sigmas(self) -> Floats:
        """Standard deviations of theta (p + folds,) before anything was measured."""
        return np.array([one.spread for one in self.free] + [OFFSET_SIGMA / MEGAPASCAL] * len(self.folds))

    @property
    def ranges(self) -> list[Range]:
        """Bounds of theta."""
        sized = [Range(one.theta_of(one.lowest), one.theta_of(one.highest), _DIFFERENCE_STEP) for one in self.free]
        return sized + [Range(-20.0, 20.0, _DIFFERENCE_STEP) for _ in self.folds]

    def injector(self, theta: Floats) -> InjectorParameters:
        """The injector at theta."""
        values = [one.value_of(float(place)) for one, place in zip(self.free, theta, strict=False)]
        return with_values(self._injector, self.free, np.array(values))

    def model(self, theta: Floats, number: int) -> EffectiveModel:
        """The model at theta of one of the folds."""
        model = effective_model(self.injector(theta))
        offset = float(theta[len(self.free) + number]) * MEGAPASCAL
        return model.with_changes("sensor", offset=model.sensor.offset + offset)

    def judge(self, theta: Floats, number: int) -> JudgedModel | None:
        """A fold at theta; None where the model has no solution."""
        p = len(self.free)
        key = (*theta[:p].tolist(), float(theta[p + number]))
        kept = self._kept[number]
        if key not in kept:
            if len(kept) >= _MOST_KEPT:
                kept.pop(next(iter(kept)))
            model = self.model(theta, number)
            is_stable = model.coefficients.line.strain(STEP) < STABLE  # sound must cross less than a cell in a step
            kept[key] = self.recordings[number].judge(model) if is_stable else None
        return kept[key]

    def judge_all(self, theta: Floats) -> list[JudgedModel] | None:
        """All folds at theta; None where the model has no solution."""
        judged = [self.judge(theta, number) for number in range(len(self.folds))]
        complete = [one for one in judged if one is not None]
        return complete if len(complete) == len(judged) else None

    def residuals(self, theta: Floats) -> Residuals | None:
        """Line pressure, rate and masses of every fold, then theta beside its prior; None without a solution.

        The pressure counts by means of innovations: cells carry short waves unlike a pipe, at the level's cost.
        """
        judged = self.judge_all(theta)
        if judged is None:
            return None
        groups = [group for number, one in enumerate(judged) for group in self._groups(number, one)]
        groups.append(((theta - self.prior_mean) / self.prior_sigmas, 0.0))
        return Residuals.of(groups)

    def _groups(self, number: int, judged_model: JudgedModel) -> list[tuple[Floats, float]]:
        fold = self.folds[number]
        samples = max(1, round(RESOLVED / fold.measurement.interval))
        # whole blocks only
        blocks = judged_model.z[: judged_model.z.size - judged_model.z.size % samples].reshape(-1, samples)
        pressure = np.asarray(blocks.sum(axis=1) / math.sqrt(samples), np.float64)
        return [
            (pressure, judged_model.log_sigma),
            (judged_model.rate_z if fold.rate_shape else judged_model.volume_z, 0.0),
            (fold.mass_residuals(judged_model.masses), 0.0),
        ]

    def residuals_of(self, theta: Floats, number: int) -> Residuals | None:
        """Residuals of one fold, without the prior."""
        judged = self.judge(theta, number)
        return None if judged is None else Residuals.of(self._groups(number, judged))


@dataclass(frozen=True, eq=False)
class Certainty:
    """Certainty of the parameters by the data alone, with unknown offsets."""

    free: tuple[FreeParameter, ...]
    sigmas: Floats  # (p,) on the scales, inf for a parameter that the data do not determine at all

    @property
    def undetermined(self) -> FreeParameter | None:
        """The least certain of the parameters that the data do not determine; None if they determine all."""
        shares = np.nan_to_num(self.sigmas) / [math.inf if one is STIFFENING else one.spread for one in self.free]
        worst = int(np.argmax(shares))
        return self.free[worst] if shares[worst] > UNDETERMINED_SHARE else None


def certainty(calibration: Calibration, at: Quadratic, inflation: float) -> Certainty:
    """Certainty at a minimum; inflation: factor of the variance for residuals that are more than noise."""
    p = len(calibration.free)
    data = at.information - np.diag(calibration.prior_sigmas**-2)
    own, cross, offsets = data[:p, :p], data[:p, p:], data[p:, p:]
    marginal = own - cross @ np.linalg.pinv(offsets, hermitian=True) @ cross.T
    return Certainty(calibration.free, sigmas_of(marginal / inflation))
