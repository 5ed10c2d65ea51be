"""Score an answer against what was hidden, by the oracle, and its model against the plant it never saw."""

import math
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.files.formats import write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.likelihood.measurement import Measurement, in_mass_window, measurements
from observer_rt.identification.likelihood.open_loop import mass, measured_mass, simulated
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY, effective_model
from observer_rt.model.parameters import EffectInForce, EffectValue, InjectorParameters
from tests.observed_plants import recording_of
from tests.plants.arrays import Array
from tests.plants.parameters import Faults, with_faults
from tests.plants.plant import REFERENCE_PRESSURE, SAMPLE_RATE, Bench, record
from tests.plants.windows import windows_of
from tools.benchmarks.campaign import Row
from tools.benchmarks.discovery import oracle
from tools.benchmarks.discovery.answers import AMBIGUOUS, Answer
from tools.benchmarks.discovery.cases import HiddenCase, nominal_benches
from tools.benchmarks.discovery.kinds import same_effect
from tools.benchmarks.discovery.rigs import GIVEN, measured_rate
from tools.benchmarks.discovery.vocabulary import ALL_EFFECTS, HIDDEN, Parts


def visibility(case: HiddenCase) -> Row:
    """How visible the hidden effect is on the recordings given, by the oracle.

    gain: what -2 log L falls with the true effect; mass_mg: largest change of an injection; pressure_mpa: largest rms
    change of the line pressure over an open phase; beyond: the dead zone.
    """
    faults = faults_of(case)
    noisy = [r for r, _ in oracle.record_all(nominal_benches(case, GIVEN), case.with_rate)]
    gain = oracle.statistic(noisy, Faults()) - oracle.statistic(noisy, faults)
    mass, pressure = 0.0, 0.0
    for r, outcome in oracle.record_all(nominal_benches(case, GIVEN, 0.0), with_rate=False):
        windows = windows_of(outcome, SAMPLE_RATE)
        with_effect, without = (true_model(r, each) for each in (faults, Faults()))
        moved = windows.masses(with_effect[1] - without[1], 1.0)
        mass = max(mass, float(np.max(np.abs(moved))) / MILLIGRAM)
        change = (with_effect[0] - without[0])[outcome.truth.needle_lift > 0.0]
        pressure = max(pressure, float(np.sqrt(np.mean(change**2))) / MEGAPASCAL)
    parameters = VOCABULARY[case.name].parameters
    beyond = not parameters or abs(case.parts[0][1][0]) >= parameters[0].dead_zone
    return {"gain": gain, "mass_mg": mass, "pressure_mpa": pressure, "beyond": beyond}


def rivalry(case: HiddenCase, answer: Answer) -> dict[str, float]:
    """By how much the oracle's -2 log L of the other effects an answer leaves open differs from the true one's."""
    others = [name for name in answer.listed if not same_effect(name, case.name)]
    if answer.verdict != AMBIGUOUS or len(others) == len(answer.listed):
        return {}
    noisy = [r for r, _ in oracle.record_all(nominal_benches(case, GIVEN), case.with_rate)]
    true = oracle.best_statistic(noisy, case.name)
    return {name: oracle.best_statistic(noisy, name) - true for name in others}


def held_intervals(truth: Parts, answer: Answer) -> list[bool]:
    """Whether each claimed 95 % interval holds the true size; of a named equivalent 1 + r inverted."""
    held = []
    for claim in answer.claims:
        effect, values = next((n, v) for n, v in truth if same_effect(n, claim["id"]))
        kind = (ALL_EFFECTS | HIDDEN)[effect]
        true = {p.name: value for p, value in zip(kind.parameters, values, strict=True)}
        if claim["id"] != effect:
            true = {name: 1.0 / (1.0 + value) - 1.0 for name, value in true.items()}
        factors = {p.name: p.si for p in VOCABULARY[claim["id"]].parameters}
        for name, parameter in claim["parameters"].items():
            low, high = (each * factors[name] for each in parameter["ci95"])
            held.append(low <= true[name] <= high)
    return held


def recordings(benches: Iterable[Bench], with_rate: bool) -> Iterator[Recording]:
    for bench in benches:
        outcome = record(bench)
        recording = recording_of(outcome)
        yield replace(recording, injection_rate=measured_rate(bench, outcome)) if with_rate else recording


def write_all(benches: Iterable[Bench], with_rate: bool, folder: Path) -> list[Path]:
    """Recordings as CSV files, named by nothing but their order."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, recording in enumerate(recordings(benches, with_rate), start=1):
        files.append(folder / f"recording_{number}.csv")
        write_recording(files[-1], recording)
    return files


def measured(benches: Iterable[Bench], with_rate: bool = True) -> tuple[Measurement, ...]:
    return measurements([*recordings(benches, with_rate)])


def gaps(benches: Iterable[Bench], injectors: Sequence[InjectorParameters]) -> tuple[list[float], ...]:
    """Rms of each injector's model minus plant on recordings without noise: of line pressures [MPa], masses [mg]."""
    further = measured(benches)
    off = [misfit(effective_model(injector), further) for injector in injectors]
    return [one.pressure_mpa for one in off], [one.mass_mg for one in off]


@dataclass(frozen=True)
class Misfit:
    """Rms of model minus plant at other operating points; flow: largest difference as share of an injection's."""

    pressure_mpa: float
    mass_mg: float
    flow: float = 0.0


def misfit(model: EffectiveModel, further: Sequence[Measurement]) -> Misfit:
    """Of a model, against recordings without noise; inf where it has no solution."""
    pressures, masses, flow = [], [], 0.0
    try:
        for measurement in further:
            for run in simulated(measurement, model):
                inside = in_mass_window(measurement, run.event, run.rate_samples)
                off = run.line_pressure - measurement.recording.line_pressure[run.samples]
                pressures.append(off[inside] / MEGAPASCAL)
                true = measurement.recording.injection_rate
                assert true is not None  # these have one
                off_rate = np.abs(run.rate - true[run.rate_samples])[inside]
                flow = max(flow, float(np.max(off_rate) / np.max(true)))
                density = model.coefficients.density
                off_mass = mass(measurement, run, density) - measured_mass(measurement, run, density)
                masses.append(off_mass / MILLIGRAM)
    except ArithmeticError:
        return Misfit(math.inf, math.inf, math.inf)
    values = (*(float(np.sqrt(np.mean(np.square(found)))) for found in (np.concatenate(pressures), masses)), flow)
    return Misfit(*(value if math.isfinite(value) else math.inf for value in values))


def injector_of(text: str) -> InjectorParameters:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "injector.toml"
        path.write_text(text)
        return load_injector(path)


def faults_of(case: HiddenCase) -> Faults:
    return HIDDEN[case.name].faults(case.parts[0][1]) if case.parts else Faults()


def true_model(r: oracle.OracleRecording, faults: Faults) -> tuple[Array, Array]:
    """Recorded line pressure [Pa] and mass flow [kg/s] (n,) of the true model with these faults."""
    errors, rate, _ = oracle.simulated(r, faults, closed_loop=False)
    line = r.line - errors * (1.0 + faults.line_pressure_sensor_gain)
    return line, rate * with_faults(r.bench.injector, faults).density


def in_terms_of(fitted: InjectorParameters, case: HiddenCase) -> Parts:
    """The hidden effects at the sizes a fitted model has to have: entrained air softens the line by K_L g, and the
    stiffness changes with pressure by n/K_L, where K_L is the model's, which stands for what it lacks of the line.
    """
    assert case.rig is not None
    part, fluid = case.rig.plant.part, fitted.fluid
    true = part.bulk_modulus_line + part.stiffening * REFERENCE_PRESSURE
    by_pressure = fluid.bulk_modulus_by_pressure or 0.0
    stiffness = (fluid.bulk_modulus_line + by_pressure * REFERENCE_PRESSURE) / true
    factors = {"entrained_air": 1.0 / stiffness, "pressure_dependent_bulk_modulus": stiffness}
    return tuple((name, tuple(factors.get(name, 1.0) * value for value in values)) for name, values in case.parts)


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


def smallest_visible(answer: Answer) -> dict[str, float]:
    """Smallest visible size of every effect's first parameter, SI."""
    sizes = {}
    for entry in answer.smallest:
        first = VOCABULARY[entry["id"]].parameters[:1]
        if first and entry["parameter"] == first[0].name and math.isfinite(entry["value"]):
            sizes[entry["id"]] = abs(entry["value"]) * first[0].si
    return sizes
