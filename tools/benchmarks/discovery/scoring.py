"""Score a case: the oracle on what was hidden, the package on what was answered."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.estimation.predictor import NO_SLOPES, Setting, Window, follow
from observer_rt.estimation.scalars import nothing_learned
from observer_rt.evidence.measurement import measurements
from observer_rt.evidence.windows import TrueInputs
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.model.effects import VOCABULARY, effective_model
from observer_rt.model.line.interface import rest_line
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import substeps_needed
from observer_rt.recording.signals.recording import Recording
from tools.benchmarks.discovery.answers import Answer, Claim
from tools.benchmarks.discovery.asking import Answered
from tools.benchmarks.discovery.cases import FURTHER, GIVEN, HiddenCase, benches, without_noise
from tools.benchmarks.discovery.hidden import HEALTHY, HIDDEN, HiddenParameter, same_effect
from tools.benchmarks.discovery.oracle import Recorded, best_statistic, record_all, simulated, statistic
from tools.benchmarks.discovery.result import AMBIGUOUS, CaseResult, Gap, Interval, Visibility
from tools.benchmarks.plant import SAMPLE_RATE
from tools.benchmarks.plant_parameters import Faults, with_faults
from tools.benchmarks.score import Windows, windows_of
from tools.benchmarks.scoring import recording_of

SUBSTEPS = 10  # at 100 kHz, or what is needed: of the nominal injector a fifth, at the largest orifice
Model = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Recorded line pressure [Pa] and mass flow [kg/s] (n,) of a model or of the plant."""


def score_answered(answered: Answered[HiddenCase]) -> CaseResult:
    """Work of one process: what the oracle and the package make of an opened case and its answer."""
    case, answer = answered.case, answered.answer
    result = CaseResult(
        label=case.label,
        effect=case.effect,
        values=case.values,
        with_rate=case.with_rate,
        verdict=answer.verdict,
        claims=tuple((claim.id, claim.confidence) for claim in answer.claims),
        listed=answer.listed,
        visibility=None if case.effect == HEALTHY else visibility(case),
        rivalry=rivalry(case, answer),
        intervals=(),
        line_pressure=None,
        injected_mass=None,
        seconds=answer.seconds,
        core_seconds=answer.core_seconds,
    )
    if result.named_right:
        result = replace(
            result,
            intervals=intervals(case.effect, HIDDEN[case.effect].parameters, case.values, answer.claims[0]),
        )
    if result.above_noise and not VOCABULARY[case.effect].remedy:  # else no amended model has it in force
        line_pressure, injected_mass = gaps(case, answer.amended_model)
        result = replace(result, line_pressure=line_pressure, injected_mass=injected_mass)
    return result


def visibility(case: HiddenCase) -> Visibility:
    """How visible the hidden effect is on the recordings given."""
    noisy = [r for r, _ in record_all(benches(case, GIVEN), case.with_rate)]
    gain = statistic(noisy, Faults()) - statistic(noisy, case.faults)
    mass, pressure = 0.0, 0.0
    for r, outcome in record_all(without_noise(case, GIVEN), with_rate=False):
        windows = windows_of(outcome, SAMPLE_RATE)
        with_effect, without = (_oracle(r, faults) for faults in (case.faults, Faults()))
        moved = windows.masses(with_effect[1] - without[1], 1.0)
        mass = max(mass, float(np.max(np.abs(moved))) / MILLIGRAM)
        change = (with_effect[0] - without[0])[outcome.truth.needle_lift > 0.0]
        pressure = max(pressure, float(np.sqrt(np.mean(change**2))) / MEGAPASCAL)
    parameters = VOCABULARY[case.effect].parameters
    beyond = not parameters or abs(case.values[0]) >= parameters[0].dead_zone
    return Visibility(gain, mass, pressure, beyond)


def rivalry(case: HiddenCase, answer: Answer) -> tuple[tuple[str, float], ...]:
    """What the oracle says of the other effects of an ambiguous answer, against the true one."""
    others = [name for name in answer.listed if not same_effect(name, case.effect)]
    if answer.verdict != AMBIGUOUS or len(others) == len(answer.listed):
        return ()
    noisy = [r for r, _ in record_all(benches(case, GIVEN), case.with_rate)]
    true = best_statistic(noisy, case.effect)
    return tuple((name, best_statistic(noisy, name) - true) for name in others)


def intervals(
    effect: str, parameters: Sequence[HiddenParameter], values: Sequence[float], claim: Claim
) -> tuple[Interval, ...]:
    """The claimed intervals, SI, beside the true values; where an exact equivalent was named, its 1 + r inverted."""
    named = VOCABULARY[claim.id]
    true = {p.name: value for p, value in zip(parameters, values, strict=True)}
    if claim.id != effect:
        true = {name: 1.0 / (1.0 + value) - 1.0 for name, value in true.items()}
    factors = {p.name: p.si for p in named.parameters}
    return tuple(
        Interval(p.name, p.low * factors[p.name], p.high * factors[p.name], true[p.name])
        for p in claim.parameters
    )


def gaps(case: HiddenCase, amended_model: str) -> tuple[Gap, Gap]:
    """Gap of line pressure [MPa] and injected mass [mg] on recordings that were not given."""
    nominal = load_injector()
    amended = injector_of(amended_model)
    before, after, oracle = [], [], []
    for r, outcome in record_all(without_noise(case, FURTHER), with_rate=False):
        windows = windows_of(outcome, SAMPLE_RATE)
        density = with_faults(r.bench.injector, case.faults).density
        plant = r.line, outcome.truth.injection_rate * density
        recording = recording_of(outcome)
        before.append(differences_of(open_loop(nominal, recording), plant, windows))
        after.append(differences_of(open_loop(amended, recording), plant, windows))
        oracle.append(differences_of(_oracle(r, case.faults), plant, windows))
    pressures, masses = (Gap(*(rms(found, signal) for found in (before, after, oracle))) for signal in (0, 1))
    return pressures, masses


def injector_of(text: str) -> InjectorParameters:
    """The injector of an injector file's text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "injector.toml"
        path.write_text(text)
        return load_injector(path)


def _oracle(r: Recorded, faults: Faults) -> Model:
    """The true model with these faults on a recording's inputs."""
    errors, rate, _ = simulated(r, faults, closed_loop=False)
    line = r.line - errors * (1.0 + faults.line_pressure_sensor_gain)
    return line, rate * with_faults(r.bench.injector, faults).density


def differences_of(model: Model, plant: Model, windows: Windows) -> Model:
    """Differences of the line pressure at the windows' samples [MPa], and of every injection's mass [mg]."""
    samples = np.concatenate([np.arange(r.start, r.stop) for r in windows.ranges])
    pressure = (model[0] - plant[0])[samples] / MEGAPASCAL
    return pressure, windows.masses(model[1] - plant[1], 1.0) / MILLIGRAM


def rms(differences: Sequence[Model], signal: int) -> float:
    """Of the line pressure (0) or the masses (1)."""
    return float(np.sqrt(np.mean(np.concatenate([d[signal] for d in differences]) ** 2)))


def open_loop(
    injector: InjectorParameters, recording: Recording
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Line pressure as the model's sensor records it [Pa] (n,), and injected mass flow [kg/s] (n,)."""
    model = effective_model(injector)
    c, sensor = model.coefficients, model.sensor
    (measurement,) = measurements([recording])
    inputs = TrueInputs(measurement, model.inputs, c)
    u = np.stack((inputs.rail, inputs.area), axis=1)
    start = np.zeros(c.states + 1)
    start[-1] = inputs.rail[0]
    rest_line(start[:-1], start[-1], c.line)
    window = Window(
        inputs=u,
        output=np.zeros(recording.samples),
        resting=np.zeros(recording.samples, np.bool_),
        start=start,
        opening=recording.samples,
    )
    errors, rate = np.empty((2, recording.samples))
    substeps = max(SUBSTEPS, substeps_needed(model.injector, recording.sample_rate, model.departures))
    setting = Setting(
        measurement.interval, substeps, c, np.zeros(c.states), lag=sensor.lag, program=model.program
    )
    follow(window, setting, nothing_learned(c), 0, errors, rate, None, NO_SLOPES)
    indicated = -errors * c.pressure_scale + c.chamber_pressure + sensor.offset
    indicated[0] = indicated[1]
    late = sensor.delay / measurement.interval
    sample = np.arange(recording.samples)
    return np.interp(sample - late, sample, indicated), rate * c.density
