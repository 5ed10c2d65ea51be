"""From recordings to the whole answer: check, find, name, add, show."""

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date

from observer_rt.discovery.add import in_force, reason_for
from observer_rt.discovery.amend import amendment
from observer_rt.discovery.evidence.measurement import Measurement
from observer_rt.discovery.evidence.operating_points import by_operating_point
from observer_rt.discovery.evidence.standstill import standstill_checks
from observer_rt.discovery.findings import Findings
from observer_rt.discovery.opinion import Opinion
from observer_rt.discovery.report.figures import Overlay
from observer_rt.discovery.report.gaps import amended_by, gaps_of
from observer_rt.discovery.report.overlays import typical_overlays
from observer_rt.discovery.report.text import headline
from observer_rt.discovery.result import Discovery, Verdict
from observer_rt.discovery.search.adequacy import NO_BASELINE, HealthyBaseline
from observer_rt.discovery.search.candidates import FitMemory
from observer_rt.discovery.search.consequences import of_candidates, of_effects
from observer_rt.discovery.search.disagreement import disagreements
from observer_rt.discovery.search.likelihood import evidence_of
from observer_rt.discovery.search.verdict import Options, healthy_baseline, name_effects
from observer_rt.foundation.errors import ObserverError
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import EffectInForce, InjectorParameters
from observer_rt.recording.signals.recording import Recording

_HEALTHY, _NAMED, _SHOWN = 0.4, 0.85, 0.9  # shares of the work done after these steps

AskObserver = Callable[[InjectorParameters, Sequence[Recording]], Opinion | None]
"""What the learning observer says of recordings; raises `ObserverError` where it cannot take them."""


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked. healthy: recordings the model is judged against; hashes: SHA-256 of the recordings by name."""

    parameters: InjectorParameters
    measured: tuple[Measurement, ...]
    healthy: tuple[Measurement, ...]
    hashes: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Answer:
    """What came out. effects: all that the amended model has in force, empty when nothing is added."""

    findings: Findings
    overlays: tuple[Overlay, ...]
    effects: tuple[EffectInForce, ...]


def answer(
    question: Question,
    memory: FitMemory,
    ask_observer: AskObserver,
    progress: Callable[[float], None],
    amended_model: str,
) -> Answer:
    """Everything but the time it took; progress is told the share done, amended_model is the name of its file.

    Raises `RunError` when the model has no solution on the recordings.
    """
    nominal = effective_model(question.parameters)
    points = by_operating_point(question.measured)
    measured = [point.measurement for point in points]
    workers = len(os.sched_getaffinity(0))
    baseline, warning = _judged_by_healthy(nominal, question.healthy, workers)
    begin = _HEALTHY if question.healthy else 0.0
    progress(begin)
    options = Options(workers, memory, lambda share: progress(begin + (_NAMED - begin) * share), baseline)
    found = name_effects(nominal, measured, options)
    gaps = gaps_of(found, measured, nominal)
    progress(_SHOWN)
    evidence = evidence_of(measured, nominal)
    files = tuple(question.hashes)
    several = Counter(point.file for point in points)
    names = tuple(
        files[point.file] if several[point.file] == 1 else f"{files[point.file]}, {point.name}"
        for point in points
    )
    findings = Findings(
        discovery=found,
        where=disagreements(found, evidence, nominal),
        gaps=gaps,
        candidates=of_candidates(found, measured, nominal),
        effects=of_effects(found, measured, nominal),
        checks=standstill_checks(question.measured, evidence, nominal, amended_by(found, nominal)),
        opinion=_opinion(ask_observer, question),
        healthy_warning=warning,
        amended_model=amended_model if found.effects else None,
        files=files,
        points=names,
        fitted_on=tuple(names[i] for i in gaps.fitted_on),
        held_out=tuple(names[i] for i in gaps.held_out),
    )
    overlays = typical_overlays(found, gaps, measured, nominal)
    return Answer(findings, overlays, _in_force(question, found, measured))


def _judged_by_healthy(
    nominal: EffectiveModel, healthy: Sequence[Measurement], workers: int
) -> tuple[HealthyBaseline, str]:
    """What healthy recordings leave unexplained, and what they say against the model, if anything."""
    if not healthy:
        return NO_BASELINE, ""
    points = [point.measurement for point in by_operating_point(healthy)]
    baseline, found = healthy_baseline(nominal, points, workers)
    if found.verdict is Verdict.NONE:
        return baseline, ""
    return baseline, (
        f"On the healthy recordings discovery says '{headline(found)}': the model itself is not that of this "
        "injector, and what is named here may be its error. `observer-rt fit` adapts it to healthy recordings."
    )


def _opinion(ask_observer: AskObserver, question: Question) -> Opinion | None:
    try:
        return ask_observer(question.parameters, [one.recording for one in question.measured])
    except ObserverError:
        return None  # not a matter of discovery: the report says that there is none


def _in_force(
    question: Question, found: Discovery, measured: Sequence[Measurement]
) -> tuple[EffectInForce, ...]:
    if not found.effects:
        return ()
    amended = amendment(question.parameters, found, measured)
    today = date.today()
    new = [in_force(effect, reason_for(found, effect, question.hashes), today) for effect in amended.found]
    return (*amended.kept, *new)
