"""The amended injector file: effects and terms in force with those found, an effect found again as one total."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.injector_file import InjectorFile, section_of, tables_in_force
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.identification.discovery.caveats import counter_restarts
from observer_rt.identification.discovery.search.candidates import Size, minimum_from, sizing
from observer_rt.identification.discovery.search.results import Discovery, FittedEffect, Verdict
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import shortened
from observer_rt.model.baseline import HealthyShape, Remainder
from observer_rt.model.effects import effective_model, sized_in_force
from observer_rt.model.parameters import EffectInForce, InjectorParameters
from observer_rt.model.stability import in_stable_cells
from observer_rt.model.terms.in_force import TermInForce
from observer_rt.model.terms.term import Term

AMENDED = "amended.toml"  # name of its file
ORIGIN = "observer-rt discover"
REMAINDER = "remainder"


def amended_effects(
    parameters: InjectorParameters,
    discovery: Discovery,
    measured: Sequence[Measurement],
    recordings: Mapping[str, str],
    healthy: HealthyShape | None = None,
) -> tuple[EffectInForce, ...]:
    """Effects that the amended file has in force, empty if none was found; those in force before are fitted anew.

    recordings: SHA-256 by file name; healthy: mean innovation that is subtracted. Raises `RunError` if the fit fails.
    """
    if not discovery.effects:
        return ()
    ids = discovery.named.ids
    kept = tuple(effect for effect in parameters.effects if effect.id not in ids)
    again = {effect.id: sized_in_force(effect).values for effect in parameters.effects if effect.id in ids}
    sizes = {effect.id: effect.parameters for effect in discovery.effects}
    if again:
        sizes = _totals(parameters.model_copy(update={"effects": kept}), again, discovery, measured, healthy)
    why = {"origin": ORIGIN, "date": date.today().isoformat()}
    added = (
        EffectInForce(id=one.id, parameters=sizes[one.id], evidence=_reason(discovery, one, recordings), **why)
        for one in discovery.effects
    )
    return (*kept, *added)


def accepted(
    parameters: InjectorParameters, discovery: Discovery, number: int, recordings: Mapping[str, str]
) -> tuple[tuple[EffectInForce, ...], tuple[TermInForce, ...]]:
    """Effects and terms in force with a proposal, counted from 1. Raises `UserError` if it is missing or refused."""
    option, many = f"--accept-term {number}", len(discovery.proposals)
    if not 1 <= number <= many:
        answer = f"there are {many}" if many else f"the verdict is '{discovery.verdict.value}'"
        raise UserError(option, f"there is no such proposal: {answer}", "see the report")
    proposal = discovery.proposals[number - 1]
    if proposal.refusal is not None:
        reason, remedy = proposal.refusal
        raise UserError(option, f"no model may have this proposal: {reason}", remedy)
    evidence = f"-2 log L falls by {proposal.gain:.0f}; {', '.join(shortened(recordings))}"
    if proposal.part is not None:
        evidence += f"; in part: closes {proposal.part.closed:.0%} of the gap held out, see [remainder]"
    evidence = "; ".join((evidence, *counter_restarts(proposal.terms)))
    why = {"origin": ORIGIN, "evidence": evidence, "date": date.today().isoformat()}
    sizes = proposal.candidate.parameters
    effects = [EffectInForce(id=one, parameters=sizes[one], **why) for one in proposal.candidate.named]
    terms = [TermInForce.of(_rounded(term), str(term.equation.unit), proposal.seen, **why) for term in proposal.terms]
    return (*parameters.effects, *effects), (*parameters.terms, *terms)


def _rounded(term: Term) -> Term:
    low, high = term.interval or (term.coefficient, term.coefficient)
    value, low, high = (float(f"{each:.6g}") for each in (term.coefficient, low, high))
    return replace(term, coefficient=value, interval=(low, high))


def stable_cells(
    parameters: InjectorParameters, in_force: Sequence[EffectInForce], measured: Sequence[Measurement]
) -> int | None:
    """Cells that the amended file must state if effects make waves too fast for those of the file; else None."""
    model = effective_model(parameters.model_copy(update={"effects": tuple(in_force)}))
    highest = max(float(np.nanmax(one.recording.rail_pressure)) for one in measured)
    stable = in_stable_cells(model, max(one.interval for one in measured), highest)
    if stable is None or stable.injector.line.cells == model.injector.line.cells:
        return None
    return stable.injector.line.cells


def write_amended(
    path: Path,
    file: InjectorFile,
    effects: Sequence[EffectInForce],
    cells: int | None = None,
    terms: Sequence[TermInForce] = (),
    remainder: Remainder | None = None,
) -> None:
    """Write the file with exactly these effects and terms in force. Raises `RunError` if it cannot be loaded again.

    cells: of the line, None for those of the file; remainder: residuals of terms accepted in part.
    """
    with file.changed(path) as document:
        content: Any = document
        for name, entries in (("effects", effects), ("terms", terms)):
            content.pop(name, None)
            if entries:
                content[name] = tables_in_force(entries)
        content.pop(REMAINDER, None)
        if remainder is not None:
            content[REMAINDER] = section_of(remainder.model_dump(mode="json", exclude_none=True))
        if cells is not None:
            content["line"]["cells"] = cells


def _totals(
    others: InjectorParameters,
    again: Mapping[str, tuple[float, ...]],
    discovery: Discovery,
    measured: Sequence[Measurement],
    healthy: HealthyShape | None,
) -> dict[str, dict[str, Size]]:
    """Sizes of the effects found, fitted to a model without them; again: sizes in force before, by id [SI]."""
    base, hypothesis = effective_model(others), discovery.named.hypothesis
    before = [np.array(again.get(effect.id, 0.0 * values)) for effect, values, _ in discovery.named.parts]
    start = discovery.named.theta + np.concatenate(before)
    problem = sizing(joint_likelihood(measured, base, healthy), base, hypothesis)
    fitted = minimum_from(problem, hypothesis.ranges(), [start])
    if fitted is None:
        raise RunError(f"{', '.join(again)}: the size in force and the one found make no model together")
    half = NORMAL_975 * math.sqrt(max(1.0, float(np.mean(fitted.residuals.z**2)))) * fitted.sigmas()
    return replace(discovery.named, sizes=tuple(fitted.theta.tolist()), half=tuple(half.tolist())).parameters


def _reason(discovery: Discovery, effect: FittedEffect, recordings: Mapping[str, str]) -> str:
    or_else = ", ".join(effect.indistinguishable_from)
    doubt = f"; cannot be told from {or_else}" if or_else else ""
    if discovery.verdict is Verdict.AMBIGUOUS:
        doubt += ", chosen by --choose"
    return (
        f"verdict {discovery.verdict.value}, confidence {discovery.confidence:.2f}{doubt}; "
        f"-2 log L falls by {effect.gain:.0f} (threshold {discovery.detection.threshold:.0f}); "
        f"{', '.join(shortened(recordings))}"
    )
