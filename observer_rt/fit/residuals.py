"""What the file's model and the fitted one leave unexplained, beside each other, by signal and phase."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.phases import Phase
from observer_rt.evidence.coverage import is_chosen
from observer_rt.evidence.likelihood import Evidence, JudgedModel
from observer_rt.evidence.open_loop import Simulated, mass, measured_mass, simulated
from observer_rt.evidence.pooled import Pool, Signal, pool_of
from observer_rt.fit.held_out import UnexplainedSignal, unexplained
from observer_rt.fit.parts import Part
from observer_rt.fit.problem import Calibration
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import InjectorParameters


@dataclass(frozen=True)
class Residual:
    """A signal in a phase, before and after the fit; nan where the file's model has no solution.

    rms: of the prediction's error one sample ahead [Pa or m3/s]; chi2: of its means of 8 samples, 1 for noise alone.
    """

    signal: Signal
    phase: Phase
    rms: tuple[float, float]
    chi2: tuple[float, float]


@dataclass(frozen=True)
class InjectedMass:
    """Mass of an injection [kg], by the file's model, the fitted one, and as measured; nan where there is none.

    time: when the needle opens [s]; nan of a recording so long that some injections were chosen.
    """

    recording: int
    time: float
    rail_pressure: float
    before: float
    after: float
    measured: float


@dataclass(frozen=True, eq=False)
class PartOverlay:
    """A part with the models run open loop from the opening on; before: empty where the file's has no solution."""

    part: Part
    before: Sequence[Simulated]
    after: Sequence[Simulated]


@dataclass(frozen=True, eq=False)
class Comparison:
    """The file's model and the fitted one on the recordings as they are, their rail pressure not averaged.

    after: of the line pressure, by the fitted model; open_loop: rms of the line pressure from the opening on, with
    nothing corrected, before and after [Pa].
    """

    residuals: Sequence[Residual]
    after: UnexplainedSignal
    open_loop: tuple[float, float]
    masses: Sequence[InjectedMass]
    overlays: Sequence[PartOverlay]


@dataclass(frozen=True, eq=False)
class _ModelOnParts:
    """A model on all parts."""

    pool: Pool
    judged: Sequence[JudgedModel]
    models: Sequence[EffectiveModel]
    simulated: Sequence[Sequence[Simulated]]


def compared(
    file: InjectorParameters, fitted: InjectorParameters, offsets: NDArray[np.float64], parts: Sequence[Part]
) -> Comparison:
    """offsets: of the line-pressure sensor in each part [MPa]."""
    after = _seen(fitted, offsets, parts)
    if after is None:
        raise ArithmeticError("the fitted model has no finite solution on the recordings it was fitted to")
    try:
        before = _seen(file, offsets, parts)
    except UserError:
        before = None  # too few samples for its sac: nothing to compare with
    return Comparison(
        [
            Residual(
                signal,
                phase,
                (_rms(before, parts, signal, phase), _rms(after, parts, signal, phase)),
                (_chi2(before, signal, phase), _chi2(after, signal, phase)),
            )
            for signal, statistics in after.pool.items()
            for phase in Phase
            if statistics.samples[phase] > 0
        ],
        unexplained(after.pool[Signal.LINE_PRESSURE]),
        (_open_loop(before, parts), _open_loop(after, parts)),
        _masses(before, after, parts),
        [
            PartOverlay(part, () if before is None else before.simulated[i], after.simulated[i])
            for i, part in enumerate(parts)
        ],
    )


def _seen(
    injector: InjectorParameters, offsets: NDArray[np.float64], parts: Sequence[Part]
) -> _ModelOnParts | None:
    calibration = Calibration(injector, (), parts)
    judged = calibration.judge_all(offsets)
    if judged is None:
        return None
    models = [calibration.model(offsets, number) for number in range(len(parts))]
    runs = [simulated(part.measurement, model) for part, model in zip(parts, models, strict=True)]
    return _ModelOnParts(pool_of(Evidence(calibration.trials), judged), judged, models, runs)


def _chi2(seen: _ModelOnParts | None, signal: Signal, phase: Phase) -> float:
    return math.nan if seen is None else unexplained(seen.pool[signal]).chi2[phase]


def _rms(seen: _ModelOnParts | None, parts: Sequence[Part], signal: Signal, phase: Phase) -> float:
    """In the signal's unit: normalised mean square times the standard deviation it was normalised by."""
    if seen is None:
        return math.nan
    variance = seen.pool[signal].variance(phase)
    if signal is Signal.INJECTION_RATE:
        return math.sqrt(variance) * float(np.mean([part.measurement.rate_noise for part in parts]))
    scale = seen.models[0].coefficients.pressure_scale
    return math.sqrt(variance) * scale * float(np.mean([math.exp(one.log_sigma) for one in seen.judged]))


def _open_loop(seen: _ModelOnParts | None, parts: Sequence[Part]) -> float:
    if seen is None:
        return math.nan
    errors = [
        one.line_pressure - part.measurement.recording.line_pressure[one.samples]
        for part, runs in zip(parts, seen.simulated, strict=True)
        for one in runs
    ]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _masses(before: _ModelOnParts | None, after: _ModelOnParts, parts: Sequence[Part]) -> list[InjectedMass]:
    result = []
    for number, part in enumerate(parts):
        measurement = part.measurement
        for i, one in enumerate(after.simulated[number]):
            first = one.event.openings[0].first
            single = {} if part.weighed is None else part.weighed.single
            density = after.models[number].coefficients.density
            weighed = single[first][0] if first in single else measured_mass(measurement, one, density)
            result.append(
                InjectedMass(
                    part.recording,
                    math.nan if is_chosen(measurement) else float(measurement.recording.time[first]),
                    measurement.rail_pressure,
                    math.nan if before is None else mass(measurement, before.simulated[number][i], density),
                    mass(measurement, one, density),
                    weighed,
                )
            )
    return result
