"""Score an answer: against what was hidden, and the model it amended against the plant it never saw."""

import math
from collections.abc import Iterator
from dataclasses import replace

from observer_rt.config.bench import load_injector
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import EffectInForce, EffectValue, InjectorParameters
from tools.benchmarks.discovery.answers import Answer
from tools.benchmarks.discovery.asking import Answered
from tools.benchmarks.discovery.hidden import same_effect
from tools.benchmarks.discovery.real_line.cases import RealCase, further_benches
from tools.benchmarks.discovery.real_line.discrepancies import plant_of
from tools.benchmarks.discovery.real_line.hidden import Parts, known
from tools.benchmarks.discovery.real_line.result import RealGap, RealResult
from tools.benchmarks.discovery.result import NAMED, Interval
from tools.benchmarks.discovery.scoring import Model, differences_of, injector_of, intervals, open_loop, rms
from tools.benchmarks.plant import SAMPLE_RATE, record
from tools.benchmarks.plant_parameters import with_faults
from tools.benchmarks.score import windows_of
from tools.benchmarks.scoring import recording_of


def score_answered(answered: Answered[RealCase]) -> RealResult:
    """Work of one process: what comes of an opened case, an answer to it, and the fitted model it was given with."""
    case, answer, model = answered.case, answered.answer, answered.model
    result = RealResult(
        label=case.label,
        kind=case.kind,
        discrepancy=str(case.rig.discrepancy),
        with_rate=case.rig.with_rate,
        parts=case.parts,
        verdict=answer.verdict,
        claims=tuple((claim.id, claim.confidence) for claim in answer.claims),
        listed=answer.listed,
        smallest=tuple(_smallest(answer)),
        intervals=(),
        line_pressure=None,
        injected_mass=None,
        seconds=answer.seconds,
        core_seconds=answer.core_seconds,
    )
    fitted = load_injector(model)
    truth = in_terms_of(fitted, case)
    if result.named_right:
        result = replace(result, intervals=tuple(_intervals(truth, answer)))
    if answer.verdict == NAMED and answer.amended_model != model.read_text():
        amended = injector_of(answer.amended_model)
        pressure, mass = gaps(case, fitted, amended, with_effects(amended, truth))
        result = replace(result, line_pressure=pressure, injected_mass=mass)
    return result


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


def gaps(case: RealCase, *models: InjectorParameters) -> tuple[RealGap, RealGap]:
    """Gaps of line pressure [MPa] and injected mass [mg], without noise, where nothing was given.

    models: the fitted one, the amended one, and with what is hidden in it.
    """
    off: tuple[list[Model], ...] = tuple([] for _ in models)
    for bench in further_benches(case):
        outcome = record(bench)
        windows = windows_of(outcome, SAMPLE_RATE)
        density = with_faults(bench.injector, bench.events[0].faults).density
        plant = outcome.measured.line_pressure, outcome.truth.injection_rate * density
        recording = recording_of(outcome)
        for model, differences in zip(models, off, strict=True):
            differences.append(differences_of(open_loop(model, recording), plant, windows))
    pressure, mass = (RealGap(*(rms(found, signal) for found in off)) for signal in (0, 1))
    return pressure, mass


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
