"""Runs a discovery: from recordings and a model to findings, with the amended model and all that reports show."""

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import NamedTuple

from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, is_same_rate
from observer_rt.engine.reports.learned_laws import LearnedLaw, leading
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.amend import AMENDED, ORIGIN, accepted, amended_effects
from observer_rt.identification.discovery.caveats import is_level_measured, is_like_inertance, remedies
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.injections import gaps_of, injection_gaps, mass_changes, typical_overlays
from observer_rt.identification.discovery.report.text import headline
from observer_rt.identification.discovery.search.adequacy import disagreements, healthy_of_fit
from observer_rt.identification.discovery.search.proposal import Part
from observer_rt.identification.discovery.search.proposals import variance_by_phase
from observer_rt.identification.discovery.search.results import Cell, Discovery, Verdict
from observer_rt.identification.discovery.search.verdict import healthy_baseline, name_effects
from observer_rt.identification.discovery.standstill import standstill_checks
from observer_rt.identification.likelihood import measurement
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.excerpts import by_operating_point
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import chosen_words, refuse_rates_missing
from observer_rt.model.baseline import Baseline, HealthyRemainder, Remainder
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import EffectInForce, InjectorParameters
from observer_rt.model.stability import refuse_unstable_cells
from observer_rt.model.terms.in_force import TermInForce

_HEALTHY, _NAMED, _SHOWN = 0.4, 0.85, 0.9  # shares of the work done after these steps

ObserverRemainder = Callable[[InjectorParameters, Baseline | None, Sequence[Recording]], HealthyRemainder | None]
"""Measures what the learning observer leaves of recordings with a model; see `desk.evaluation.healthy_events`."""
_INADEQUATE = "The fit of this model was not adequate: what is named here may be its error. Fit again."
_NOT_COMPARABLE = (
    "What this model leaves of the healthy injector at this sample rate is not known: what is named here may be its "
    "error. Fit again, or give healthy recordings by --healthy."
)
_AMEND_FIRST = (
    "First run `observer-rt discover --out healthy` on the healthy recordings alone, and give healthy/amended.toml "
    "as --model; where there is none, correct the injector file by drawing and data sheet."
)


@dataclass(frozen=True, eq=False)
class DiscoveryTask:
    """Recordings to be explained, and the user's wishes."""

    parameters: InjectorParameters
    measured: tuple[Measurement, ...]
    healthy: tuple[Measurement, ...]  # recordings by which the model is judged
    hashes: Mapping[str, str]  # SHA-256 of the recordings by name
    chosen: tuple[str, ...] = ()  # effects preferred among those that explain the recordings equally well
    accepted: int = 0  # number of the proposal whose terms the amended model is to have; 0: none
    observed: ObserverRemainder | None = None  # measures what a proposal accepted in part leaves
    learned: Callable[[InjectorParameters, Sequence[Recording]], tuple[LearnedLaw, ...]] | None = None
    """Learns laws from the recordings, with which the search begins."""


def refuse_incomparable(task: DiscoveryTask, model: str) -> None:
    """Raise `UserError` where recordings cannot be compared with the model of this file name, or not together."""
    refuse_rates_missing([one.recording for one in task.measured])
    first = task.measured[0]
    coefficients = first.coefficients_of(effective_model(task.parameters))
    refuse_unstable_cells(model, task.parameters, coefficients, first.interval)


def answer(task: DiscoveryTask, progress: Callable[[float], None]) -> Findings:
    """Finds the missing effect. Raises `RunError` without a solution, `UserError` for a choice not left open."""
    nominal, task = effective_model(task.parameters), _as_the_fit_saw(task)
    healthy, warning = _remembered(nominal, [*task.measured, *task.healthy])
    points = by_operating_point([measurement.with_healthy_offset(one, healthy) for one in task.measured])
    measured = [point.measurement for point in points]
    workers, baseline, begin = len(os.sched_getaffinity(0)), healthy, 0.0
    if task.healthy:
        baseline, warning = _judged_by_healthy(
            nominal, task.healthy, workers, healthy, lambda done: progress(_HEALTHY * done)
        )
        begin = _HEALTHY
    progress(begin)
    recordings = [one.without_answers for one in task.measured]
    learned = task.learned(task.parameters, recordings) if task.learned else ()
    choice = baseline, task.chosen, leading(learned)
    naming = _NAMED - begin
    discovery = name_effects(nominal, measured, workers, lambda done: progress(begin + naming * done), *choice)
    likelihood = joint_likelihood(measured, nominal, baseline.shape)
    accepted_term = task.accepted if task.accepted <= len(discovery.proposals) else 0
    shown = replace(discovery, accepted=accepted_term).shown
    gaps = gaps_of(shown, measured, nominal)
    progress(_SHOWN)
    where = disagreements(discovery, shown, likelihood, nominal)
    files, chosen = tuple(task.hashes), map(chosen_words, task.measured)
    several = Counter(point.file for point in points)
    pairs = [(files[point.file], point) for point in points]
    names = tuple(file if several[point.file] == 1 else f"{file}, {point.name}" for file, point in pairs)
    amended = shown.model(nominal)
    # halves of 95 % intervals of masses, as shares, by what the proposal shown leaves
    halves = (one.part.mass_half for one in discovery.proposals if one.candidate is shown and one.part is not None)
    amendment = _amendment(task, discovery, measured, baseline, [item.after for item in where])
    return Findings(
        **vars(discovery) | amendment._asdict(),
        where=where,
        gaps=gaps,
        checks=standstill_checks(
            task.measured, likelihood, nominal, amended, healthy.line_pressure_offset_MPa * MEGAPASCAL
        ),
        healthy_warning=warning,
        like_inertance=is_like_inertance(nominal, amended),
        level_measured=is_level_measured(nominal),
        chosen=task.chosen,
        amended_model=AMENDED if amendment.in_force or amendment.terms else None,
        overlays=typical_overlays(shown, gaps, measured, nominal),
        injections=injection_gaps(gaps, measured, nominal),
        masses=mass_changes(shown, measured, nominal, next(halves, 0.0)),
        files=files,
        recordings=dict(task.hashes),
        judged_in_part=tuple(f"{name}: {words}" for name, words in zip(files, chosen, strict=True) if words),
        points=names,
        fitted_on=tuple(names[i] for i in gaps.fitted_on),
        held_out=tuple(names[i] for i in gaps.held_out),
        healthy=tuple(one.recording.path.name for one in task.healthy if one.recording.path is not None),
        baseline=None if baseline.shape is None else baseline,
        learned=learned,
    )


def _as_the_fit_saw(task: DiscoveryTask) -> DiscoveryTask:
    """The task with a free needle where no lift was measured, and without the sensor gain that a fit found."""
    measured, healthy = measurement.with_free_needle(task.measured), measurement.with_free_needle(task.healthy)
    fitted = task.parameters.baseline
    if fitted is not None and (gain := fitted.line_pressure_sensor_gain):
        measured, healthy = measurement.without_gain(measured, gain), measurement.without_gain(healthy, gain)
    return replace(task, measured=measured, healthy=healthy)


class _Amendment(NamedTuple):
    in_force: tuple[EffectInForce, ...]
    terms: tuple[TermInForce, ...]
    not_accepted: str
    remainder: Remainder | None
    accepted: int


def _amendment(
    task: DiscoveryTask,
    discovery: Discovery,
    measured: Sequence[Measurement],
    baseline: Healthy,
    cells: Sequence[Cell],
) -> _Amendment:
    """Effects named beyond doubt or chosen, or the proposal accepted. cells: of the map, with what was found."""
    in_force: tuple[EffectInForce, ...] = ()
    if (discovery.verdict is not Verdict.AMBIGUOUS or task.chosen) and not remedies(discovery):
        in_force = amended_effects(task.parameters, discovery, measured, task.hashes, baseline.shape)
    terms = task.parameters.terms if in_force else ()
    remainder: Remainder | None = None
    refused, number = "", 0
    if task.accepted:
        try:
            in_force, terms = accepted(task.parameters, discovery, task.accepted, task.hashes)
            number = task.accepted
            part = discovery.proposals[number - 1].part
            if part is not None:
                remainder = _remainder(task, part, in_force, terms, cells)
        except UserError as error:
            refused = str(error)
    return _Amendment(in_force, terms, refused, remainder, number)


def _remainder(
    task: DiscoveryTask,
    part: Part,
    effects: tuple[EffectInForce, ...],
    terms: tuple[TermInForce, ...],
    cells: Sequence[Cell],
) -> Remainder:
    """Residuals of a model with terms accepted in part. cells: of the map, with them."""
    amended = task.parameters.model_copy(update={"effects": effects, "terms": terms, "remainder": None})
    recordings = [one.without_answers for one in task.measured]
    return Remainder(
        line_pressure_MPa=float(f"{part.left / MEGAPASCAL:.3g}"),
        mass_share=float(f"{part.mass_half / NORMAL_975:.3g}"),
        sample_rate_Hz=recordings[0].sample_rate,
        variance=variance_by_phase(cells),
        observer=task.observed(amended, amended.baseline, recordings) if task.observed else None,
        origin=ORIGIN,
        date=date.today().isoformat(),
    )


def _remembered(nominal: EffectiveModel, recordings: Sequence[Measurement]) -> tuple[Healthy, str]:
    """The healthy injector as a fitted model knows it, and a warning about that fit, empty without a doubt."""
    fitted = nominal.injector.baseline
    if fitted is None:
        return NOT_FITTED, ""
    comparable = all(is_same_rate(fitted.sample_rate_Hz, one.recording.sample_rate) for one in recordings)
    baseline = healthy_of_fit(fitted, comparable)
    if not fitted.adequate:
        return baseline, _INADEQUATE
    return baseline, "" if comparable and fitted.healthy is not None else _NOT_COMPARABLE


def _judged_by_healthy(
    nominal: EffectiveModel,
    healthy: Sequence[Measurement],
    workers: int,
    remembered: Healthy,
    progress: Callable[[float], None],
) -> tuple[Healthy, str]:
    """The remembered healthy injector and what recordings of it add, and a warning if these contradict the model."""
    found_with = [measurement.with_healthy_offset(one, remembered) for one in healthy]
    points = [point.measurement for point in by_operating_point(found_with)]
    baseline, discovery = healthy_baseline(nominal, points, workers, remembered, progress)
    if discovery.verdict is Verdict.NONE:
        return baseline, ""
    return baseline, (
        f"On the healthy recordings discovery says '{headline(discovery)}': the model itself is not that of this "
        f"injector, and what is named here may be its error. {_AMEND_FIRST}"
    )
