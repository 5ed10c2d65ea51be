"""The gap between model and measurement before and after: by operating point, and signal by phase.

Operating points are those the model was not fitted to.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT, cells_of
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.results import Cell, Discovery
from observer_rt.identification.likelihood.likelihood import GAIN_ERROR, JointLikelihood, Signal
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import mass, measured_mass, noisier, simulated
from observer_rt.identification.likelihood.operating_points import every_second_point
from observer_rt.identification.likelihood.windows import in_mass_window
from observer_rt.model.effect import Component, Effect, Equation
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import LineOutflow

LINE_PRESSURE, RATE, MASS = "line_pressure", "injection_rate", "injected_mass"
UNITS = {LINE_PRESSURE: ("MPa", MEGAPASCAL), RATE: ("mm3/ms", MM3_PER_MS), MASS: ("mg", MILLIGRAM)}
NOISE_RUNS = 3  # with noise added, for the noise floor
_Key = tuple[Signal, Phase, int]


@dataclass(frozen=True)
class Gap:
    """Root mean squares of model minus measurement, in the unit of a quantity: nominal, amended, and what noise alone
    would leave.

    measured: else it is against the model amended by all recordings: before is then what the nominal model is wrong
    if the amended one is right.
    """

    name: str
    before: float
    after: float
    noise_floor: float
    measured: bool = True

    @property
    def unit(self) -> str:
        """Its unit, as printed."""
        return UNITS[self.name][0]

    @property
    def words(self) -> str:
        """The quantity, for people."""
        return self.name.replace("_", " ")


@dataclass(frozen=True)
class PointGaps:
    """The gaps of one held-out recording by quantity, the rate only where it is measured."""

    recording: int
    by_name: Mapping[str, Gap]


@dataclass(frozen=True)
class ModelGaps:
    """Gaps over all held-out recordings, and for each. refitted: the model with what was found, fitted to
    `fitted_on`."""

    by_name: Mapping[str, Gap]
    refitted: EffectiveModel
    points: tuple[PointGaps, ...]
    fitted_on: tuple[int, ...]
    held_out: tuple[int, ...]


def gaps_of(shown: Candidate, measured: Sequence[Measurement], nominal: EffectiveModel) -> ModelGaps:
    """The gaps: with what was found refitted to every second operating point, on the others.

    With one operating point there is nothing to hold out: it is fitted and shown. shown: what was found.
    """
    amended = shown.model(nominal)
    fitted_on, held_out = every_second_point(measured)
    held_out = held_out or fitted_on
    refitted = shown.hypothesis.model(nominal, np.array(shown.sizes_of_half))
    points = tuple(_point(number, measured[number], nominal, refitted, amended) for number in held_out)
    by_name = {}
    for name, gap in points[0].by_name.items():
        every = [point.by_name[name] for point in points]
        before, after, floor = (  # root mean squares over recordings
            float(np.sqrt(np.mean([getattr(one, of) ** 2 for one in every])))
            for of in ("before", "after", "noise_floor")
        )
        by_name[name] = Gap(name, before, after, floor, gap.measured)
    return ModelGaps(by_name, refitted, points, fitted_on, held_out)


def _point(
    number: int, measurement: Measurement, nominal: EffectiveModel, refitted: EffectiveModel, amended: EffectiveModel
) -> PointGaps:
    density, is_measured = amended.coefficients.density, measurement.recording.injection_rate is not None
    true_masses = np.array(
        [measured_mass(measurement, one, density) for one in simulated(measurement, nominal)]
        if is_measured
        else [mass(measurement, one, density) for one in simulated(measurement, amended)]
    )
    before, after = (_errors(measurement, model, true_masses) for model in (nominal, refitted))
    noisy = [_errors(measurement, refitted, true_masses, seed) for seed in range(NOISE_RUNS)]
    own_errors = {LINE_PRESSURE: [measurement.noise.line_pressure]}
    if is_measured:
        runs = simulated(measurement, refitted)
        rate = [one.rate[in_mass_window(measurement, one.event, one.rate_samples)] for one in runs]
        own_errors[RATE] = [measurement.rate_noise, GAIN_ERROR * rms(np.concatenate(rate))]
    own_errors[MASS] = [GAIN_ERROR * float(np.mean(true_masses)) if is_measured else 0.0]
    by_name = {}
    for name, own in own_errors.items():
        si = UNITS[name][1]
        floor = math.hypot(*own, rms(np.concatenate([one[name] - after[name] for one in noisy])))
        with_measured = is_measured or name == LINE_PRESSURE
        by_name[name] = Gap(name, rms(before[name]) / si, rms(after[name]) / si, floor / si, with_measured)
    return PointGaps(number, by_name)


def _errors(
    measurement: Measurement, model: EffectiveModel, true_masses: NDArray[np.float64], seed: int | None = None
) -> dict[str, NDArray[np.float64]]:
    """A model minus a recording, event after event: line pressure (n,), rate while fuel is injected (m,), where it
    was measured, masses (events,) minus the true ones [SI].

    seed: of noise that is added to what the model is driven with.
    """
    line, rate = measurement.recording.line_pressure, measurement.recording.injection_rate
    runs = simulated(measurement if seed is None else noisier(measurement, seed), model)
    masses = np.array([mass(measurement, one, model.coefficients.density) for one in runs])
    errors = {
        LINE_PRESSURE: np.concatenate([one.line_pressure - line[one.samples] for one in runs]),
        MASS: masses - true_masses,
    }
    if rate is not None:
        inside = [in_mass_window(measurement, one.event, one.rate_samples) for one in runs]
        errors[RATE] = np.concatenate(
            [(one.shown_rate - rate[one.rate_samples])[part] for one, part in zip(runs, inside, strict=True)]
        )
    return errors


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class Disagreement:
    """One signal in one phase of one recording, with the nominal model and with what was found, or is nearest.

    equation: which is violated; None where the nominal model does not disagree significantly, or nobody knows.
    """

    before: Cell
    after: Cell
    equation: Equation | None


def disagreements(
    discovery: Discovery, shown: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Disagreement, ...]:
    """The map of disagreement, in the order of the recordings, before and after the shown effects: the nearest, if
    empty.

    shown: effects or terms found.
    """
    left = discovery.after
    if shown.ids != discovery.best.ids and shown.ids:
        model = shown.model(nominal)
        judged = likelihood.judge(model)
        left = () if judged is None else cells_of(likelihood, judged, model)
    after = {_key(cell): cell for cell in left}
    equations = _equations(discovery, shown, likelihood, nominal)
    result = []
    for cell in discovery.before:
        equation = equations.get(_key(cell)) if cell.excess > SIGNIFICANT else None
        result.append(Disagreement(cell, after.get(_key(cell), cell), equation))
    return tuple(result)


def _equations(
    discovery: Discovery, shown: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> dict[_Key, Equation]:
    """Finds for every cell the equation of that effect without which it is explained worst."""
    if not shown.ids and discovery.unexplained is not None:
        return {_key(cell): discovery.unexplained.equation for cell in discovery.before}
    worst: dict[_Key, tuple[float, Equation]] = {}
    for number, effect in enumerate(shown.hypothesis.effects):
        others = shown.model_without(number, nominal)
        judged = likelihood.judge(others)
        for cell in discovery.before if judged is None else cells_of(likelihood, judged, others):
            key, loss = _key(cell), cell.variance
            if key not in worst or loss > worst[key][0]:
                worst[key] = loss, violated(effect, nominal)
    return {key: equation for key, (_, equation) in worst.items()}


def violated(effect: Effect, model: EffectiveModel) -> Equation:
    """The equation of a model that is violated while an effect is missing."""
    if effect.component is Component.NOZZLE and model.injector.line_outflow is LineOutflow.SEAT:
        return Equation.SAC_PRESSURE  # the nozzle flow is in no other
    return effect.equation


def _key(cell: Cell) -> _Key:
    return cell.signal, cell.phase, cell.recording
