"""Score an answer: against what was hidden, and the model it amended against the plant it never saw."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from observer_rt.config.bench import load_injector
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import InjectorParameters
from tools.benchmarks.discovery.answers import Answer
from tools.benchmarks.discovery.hidden import same_effect
from tools.benchmarks.discovery.product_model import open_loop
from tools.benchmarks.discovery.real_line.cases import RealCase, further_benches
from tools.benchmarks.discovery.real_line.hidden import known
from tools.benchmarks.discovery.real_line.result import RealGap, RealResult
from tools.benchmarks.discovery.result import NAMED, Interval
from tools.benchmarks.discovery.scoring import Model, differences_of, injector_of, intervals, rms
from tools.benchmarks.plant import SAMPLE_RATE, record
from tools.benchmarks.plant_parameters import with_faults
from tools.benchmarks.scoring import recording_of
from tools.benchmarks.windows import windows_of


def score_case(case: RealCase, answer: Answer, model: Path) -> RealResult:
    """What comes of an opened case, an answer to it, and the fitted model it was given with."""
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
    if result.named_right:
        result = replace(result, intervals=tuple(_intervals(case, answer)))
    if answer.verdict == NAMED and answer.amended_model != model.read_text():
        pressure, mass = gaps(case, load_injector(model), injector_of(answer.amended_model))
        result = replace(result, line_pressure=pressure, injected_mass=mass)
    return result


def gaps(case: RealCase, before: InjectorParameters, after: InjectorParameters) -> tuple[RealGap, RealGap]:
    """Gaps of line pressure [MPa] and injected mass [mg] of two models, without noise, where nothing was given."""
    off: tuple[list[Model], list[Model]] = [], []
    for bench in further_benches(case):
        outcome = record(bench)
        windows = windows_of(outcome, SAMPLE_RATE)
        density = with_faults(bench.injector, bench.events[0].faults).density
        plant = outcome.measured.line_pressure, outcome.truth.injection_rate * density
        recording = recording_of(outcome)
        for model, differences in zip((before, after), off, strict=True):
            differences.append(differences_of(open_loop(model, recording), plant, windows))
    pressure, mass = (RealGap(rms(off[0], signal), rms(off[1], signal)) for signal in (0, 1))
    return pressure, mass


def _smallest(answer: Answer) -> Iterator[tuple[str, float]]:
    """Smallest visible size of every effect's first parameter, SI."""
    for one in answer.smallest:
        first = VOCABULARY[one.id].parameters[:1]
        if first and one.parameter == first[0].name and math.isfinite(one.value):
            yield one.id, abs(one.value) * first[0].si


def _intervals(case: RealCase, answer: Answer) -> Iterator[Interval]:
    for claim in answer.claims:
        effect, values = next((n, v) for n, v in case.parts if same_effect(n, claim.id))
        yield from intervals(known(effect).hidden, values, claim)
