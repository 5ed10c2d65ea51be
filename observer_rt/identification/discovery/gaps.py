"""The gap between model and measurement before and after: by operating point, and signal by phase.

Operating points are those the model was not fitted to.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT, cells_of
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.results import Cell, Discovery
from observer_rt.identification.likelihood.likelihood import GAIN_ERROR, JointLikelihood, Signal
from observer_rt.identification.likelihood.measurement import Measurement, every_second_point
from observer_rt.identification.likelihood.open_loop import (
    SimulatedInjection,
    mass,
    measured_mass,
    noisier,
    simulated,
)
from observer_rt.identification.likelihood.windows import in_mass_window
from observer_rt.model.effect import Component, Effect, Equation
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import LineOutflow

NOISE_RUNS = 3  # with noise added, for the noise floor
PHASE_NAMES = {
    Phase.STANDSTILL: "closed",
    Phase.OPENING: "opening",
    Phase.OPEN: "open",
    Phase.CLOSING: "closing",
    Phase.AFTER: "after",
}
_Key = tuple[Signal, Phase, int]


@dataclass(frozen=True)
class Gap:
    """Root mean squares of model minus measurement (SI): nominal, amended, and what noise alone would leave."""

    before: float
    after: float
    noise_floor: float


@dataclass(frozen=True)
class PrintedGap(Gap):
    """A gap in its printed unit; measured: else it is against the model with what was found."""

    name: str
    unit: str
    measured: bool

    @property
    def words(self) -> str:
        """The quantity, for people."""
        return self.name.replace("_", " ")


@dataclass(frozen=True)
class SignalGaps:
    """The gap of every signal; of the injection rate None where it is not measured."""

    line_pressure: Gap
    injection_rate: Gap | None
    mass: Gap
    injected: float  # kg, mean of an event

    @property
    def printed(self) -> dict[str, "PrintedGap"]:
        """By the name of the signal; the mass is measured where a rate is."""
        values = (
            ("line_pressure", "MPa", MEGAPASCAL, self.line_pressure, True),
            ("injection_rate", "mm3/ms", MM3_PER_MS, self.injection_rate, True),
            ("injected_mass", "mg", MILLIGRAM, self.mass, self.injection_rate is not None),
        )
        return {
            name: PrintedGap(gap.before / si, gap.after / si, gap.noise_floor / si, name, unit, measured)
            for name, unit, si, gap, measured in values
            if gap is not None
        }


@dataclass(frozen=True)
class PointGap(SignalGaps):
    """The gaps of one held-out recording."""

    recording: int


@dataclass(frozen=True)
class ModelGaps(SignalGaps):
    """Gaps over all held-out recordings, and for each.

    Mass is compared with the measured one; where no rate is measured, with that of the amended model fitted to all
    recordings: before is then what the nominal model is wrong if the amended one is right.
    """

    refitted: EffectiveModel  # the winner, fitted to `fitted_on`
    points: tuple[PointGap, ...]
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
    rates = [point.injection_rate for point in points if point.injection_rate is not None]
    return ModelGaps(
        _together([point.line_pressure for point in points]),
        _together(rates) if rates else None,
        _together([point.mass for point in points]),
        float(np.mean([point.injected for point in points])),
        refitted,
        points,
        fitted_on,
        held_out,
    )


def _point(
    number: int,
    measurement: Measurement,
    nominal: EffectiveModel,
    refitted: EffectiveModel,
    amended: EffectiveModel,
) -> PointGap:
    density, is_measured = amended.coefficients.density, measurement.recording.injection_rate is not None
    true_masses = np.array(
        [measured_mass(measurement, one, density) for one in simulated(measurement, nominal)]
        if is_measured
        else [mass(measurement, one, density) for one in simulated(measurement, amended)]
    )
    before, after = (_errors(measurement, model, true_masses) for model in (nominal, refitted))
    noisy = [_errors(measurement, refitted, true_masses, seed) for seed in range(NOISE_RUNS)]
    own_errors = {"line_pressure": [measurement.noise.line_pressure], "mass": [0.0]}
    if is_measured:
        rate = [one.rate[_injecting(measurement, one)] for one in simulated(measurement, refitted)]
        own_errors["injection_rate"] = [measurement.rate_noise, GAIN_ERROR * rms(np.concatenate(rate))]
        own_errors["mass"] = [GAIN_ERROR * float(np.mean(true_masses))]
    gaps = {
        name: Gap(
            rms(before[name]),
            rms(after[name]),
            math.hypot(*own, rms(np.concatenate([one[name] - after[name] for one in noisy]))),
        )
        for name, own in own_errors.items()
    }
    return PointGap(
        gaps["line_pressure"],
        gaps.get("injection_rate"),
        gaps["mass"],
        float(np.mean(true_masses)),
        number,
    )


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
        "line_pressure": np.concatenate([one.line_pressure - line[one.samples] for one in runs]),
        "mass": masses - true_masses,
    }
    if rate is not None:
        inside = [_injecting(measurement, one) for one in runs]
        errors["injection_rate"] = np.concatenate(
            [(one.rate - rate[one.rate_samples])[part] for one, part in zip(runs, inside, strict=True)]
        )
    return errors


def _injecting(measurement: Measurement, injection: SimulatedInjection) -> NDArray[np.bool_]:
    return in_mass_window(measurement, injection.event, injection.rate_samples)


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _together(gaps: Sequence[Gap]) -> Gap:
    """Root mean square over recordings."""
    return Gap(
        *(
            float(np.sqrt(np.mean([getattr(gap, name) ** 2 for gap in gaps])))
            for name in ("before", "after", "noise_floor")
        )
    )


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
