"""Score an answer: against what was hidden, by the oracle (tier A), and its model against the plant it never saw."""

import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import rest_state
from observer_rt.engine.estimation.predictor import NO_SLOPES, Setting, Window
from observer_rt.engine.estimation.scalars import nothing_learned
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.windows import TrueInputs
from observer_rt.model.effects import VOCABULARY, effective_model
from observer_rt.model.parameters import EffectInForce, EffectValue, InjectorParameters
from observer_rt.model.stability import substeps_needed
from tests.observed_plants import recording_of
from tests.plants.arrays import Array
from tests.plants.parameters import Faults, with_faults
from tests.plants.plant import SAMPLE_RATE, Bench, Outcome, record
from tests.plants.windows import windows_of
from tools.benchmarks.discovery import oracle
from tools.benchmarks.discovery.answers import Answer, Claim
from tools.benchmarks.discovery.asking import Answered
from tools.benchmarks.discovery.cases import FURTHER, GIVEN, HiddenCase, benches, without_noise
from tools.benchmarks.discovery.hidden import HEALTHY, HIDDEN, HiddenParameter, same_effect
from tools.benchmarks.discovery.real_line.cases import RealCase, further_benches
from tools.benchmarks.discovery.real_line.discrepancies import plant_of
from tools.benchmarks.discovery.real_line.hidden import Parts, known
from tools.benchmarks.discovery.real_line.result import RealGap, RealResult
from tools.benchmarks.discovery.result import AMBIGUOUS, NAMED, CaseResult, Gap, Interval, Visibility

SUBSTEPS = 10  # at 100 kHz, or what is needed: of the nominal injector a fifth, at the largest orifice
Model = tuple[Array, Array]
"""Recorded line pressure [Pa] and mass flow [kg/s] (n,) of a model or of the plant."""
Solve = Callable[[Bench, Outcome], Model]
"""What a model makes of a recording's inputs."""


def _said(answer: Answer) -> dict[str, Any]:
    """What every result has of an answer; what must be worked out is not there yet."""
    return {
        "verdict": answer.verdict,
        "claims": tuple((claim.id, claim.confidence) for claim in answer.claims),
        "listed": answer.listed,
        "intervals": (),
        "line_pressure": None,
        "injected_mass": None,
        "seconds": answer.seconds,
        "core_seconds": answer.core_seconds,
    }


def score_answered(answered: Answered[HiddenCase]) -> CaseResult:
    """Work of one process: what the oracle and the package make of an opened case and its answer."""
    case, answer = answered.case, answered.answer
    result = CaseResult(
        label=case.label,
        effect=case.effect,
        values=case.values,
        with_rate=case.with_rate,
        visibility=None if case.effect == HEALTHY else visibility(case),
        rivalry=rivalry(case, answer),
        **_said(answer),
    )
    if result.named_right:
        parameters = HIDDEN[case.effect].parameters
        found = intervals(case.effect, parameters, case.values, answer.claims[0])
        result = replace(result, intervals=found)
    if result.above_noise and not VOCABULARY[case.effect].remedy:  # else no amended model has it in force
        models = (solving(load_injector()), solving(injector_of(answer.amended_model)))

        def truth(bench: Bench, outcome: Outcome) -> Model:
            return _true_model(oracle.recorded(bench, outcome, with_rate=False), case.faults)

        pressure, mass = gaps(without_noise(case, FURTHER), (*models, truth))
        result = replace(result, line_pressure=Gap(*pressure), injected_mass=Gap(*mass))
    return result


def score_real(answered: Answered[RealCase]) -> RealResult:
    """The same of a real line: what comes of an opened case, an answer to it, and the fitted model it was given."""
    case, answer, model = answered.case, answered.answer, answered.model
    result = RealResult(
        label=case.label,
        kind=case.kind,
        discrepancy=str(case.rig.discrepancy),
        with_rate=case.rig.with_rate,
        parts=case.parts,
        smallest=tuple(_smallest(answer)),
        **_said(answer),
    )
    fitted = load_injector(model)
    truth = in_terms_of(fitted, case)
    if result.named_right:
        result = replace(result, intervals=tuple(_intervals(truth, answer)))
    if answer.verdict == NAMED and answer.amended_model != model.read_text():
        amended = injector_of(answer.amended_model)
        models = map(solving, (fitted, amended, with_effects(amended, truth)))
        pressure, mass = gaps(further_benches(case), tuple(models))
        result = replace(result, line_pressure=RealGap(*pressure), injected_mass=RealGap(*mass))
    return result


def visibility(case: HiddenCase) -> Visibility:
    """How visible the hidden effect is on the recordings given."""
    noisy = [r for r, _ in oracle.record_all(benches(case, GIVEN), case.with_rate)]
    gain = oracle.statistic(noisy, Faults()) - oracle.statistic(noisy, case.faults)
    mass, pressure = 0.0, 0.0
    for r, outcome in oracle.record_all(without_noise(case, GIVEN), with_rate=False):
        windows = windows_of(outcome, SAMPLE_RATE)
        with_effect, without = (_true_model(r, faults) for faults in (case.faults, Faults()))
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
    noisy = [r for r, _ in oracle.record_all(benches(case, GIVEN), case.with_rate)]
    true = oracle.best_statistic(noisy, case.effect)
    return tuple((name, oracle.best_statistic(noisy, name) - true) for name in others)


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


def gaps(benches: Iterable[Bench], models: Sequence[Solve]) -> tuple[list[float], list[float]]:
    """Rms of each model minus plant where nothing was given: of line pressures [MPa] and of injected masses [mg]."""
    off: list[list[Model]] = [[] for _ in models]
    for bench in benches:
        outcome = record(bench)
        windows = windows_of(outcome, SAMPLE_RATE)
        samples = np.concatenate([np.arange(r.start, r.stop) for r in windows.ranges])
        density = with_faults(bench.injector, bench.events[0].faults).density
        for solve, differences in zip(models, off, strict=True):
            line, flow = solve(bench, outcome)
            pressure = (line - outcome.measured.line_pressure)[samples] / MEGAPASCAL
            mass = windows.masses(flow - outcome.truth.injection_rate * density, 1.0) / MILLIGRAM
            differences.append((pressure, mass))
    of_pressure, of_mass = (
        [float(np.sqrt(np.mean(np.concatenate([d[signal] for d in each]) ** 2))) for each in off]
        for signal in (0, 1)
    )
    return of_pressure, of_mass


def solving(injector: InjectorParameters) -> Solve:
    """The package's model of an injector, open loop."""
    return lambda _, outcome: open_loop(injector, recording_of(outcome))


def injector_of(text: str) -> InjectorParameters:
    """The injector of an injector file's text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "injector.toml"
        path.write_text(text)
        return load_injector(path)


def _true_model(r: oracle.Recorded, faults: Faults) -> Model:
    """The true model with these faults on a recording's inputs."""
    errors, rate, _ = oracle.simulated(r, faults, closed_loop=False)
    line = r.line - errors * (1.0 + faults.line_pressure_sensor_gain)
    return line, rate * with_faults(r.bench.injector, faults).density


def open_loop(injector: InjectorParameters, recording: Recording) -> tuple[Array, Array]:
    """Line pressure as the model's sensor records it [Pa] (n,), and injected mass flow [kg/s] (n,)."""
    model = effective_model(injector)
    c, sensor = model.coefficients, model.sensor
    (measurement,) = measurements([recording])
    inputs = TrueInputs(measurement, model.inputs, c)
    u = np.stack((inputs.rail, inputs.area), axis=1)
    start = np.zeros(c.states + 1)
    start[-1] = inputs.rail[0]
    rest_state(start[:-1], start[-1], c)
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


def in_terms_of(fitted: InjectorParameters, case: RealCase) -> Parts:
    """What is hidden at the sizes a fitted model has to have: entrained air softens the line by K_L g, and the
    stiffness changes with pressure by n/K_L, where K_L is the model's, which stands for what it lacks of the line.
    """
    part = plant_of(case.rig.discrepancy, case.rig.seed).part
    stiffness = fitted.fluid.bulk_modulus_line / part.bulk_modulus_line
    factors = {"entrained_air": 1.0 / stiffness, "pressure_dependent_bulk_modulus": stiffness}
    return tuple(
        (name, tuple(factors.get(name, 1.0) * value for value in values)) for name, values in case.parts
    )


def with_effects(injector: InjectorParameters, parts: Parts) -> InjectorParameters:
    """An injector with these effects in force, and no others; those no name is for are left out."""
    in_force = []
    for name, values in parts:
        if name in VOCABULARY:
            sizes = {
                p.name: EffectValue(value=value / p.si, unit=p.unit)
                for p, value in zip(VOCABULARY[name].parameters, values, strict=True)
            }
            in_force.append(EffectInForce(id=name, parameters=sizes))
    return injector.model_copy(update={"effects": tuple(in_force)})


def _smallest(answer: Answer) -> Iterator[tuple[str, float]]:
    """Smallest visible size of every effect's first parameter, SI."""
    for one in answer.smallest:
        first = VOCABULARY[one.id].parameters[:1]
        if first and one.parameter == first[0].name and math.isfinite(one.value):
            yield one.id, abs(one.value) * first[0].si


def _intervals(truth: Parts, answer: Answer) -> Iterator[Interval]:
    for claim in answer.claims:
        effect, values = next((n, v) for n, v in truth if same_effect(n, claim.id))
        yield from intervals(effect, known(effect).parameters, values, claim)
