"""Laws of another equation that line pressure cannot tell from a proposal: fitted beside it, with their masses."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.hypothesis import Hypothesis, Sizing
from observer_rt.identification.discovery.search.proposals import unsound
from observer_rt.identification.discovery.search.results import Candidate, Proposal
from observer_rt.identification.discovery.search.term_search import TIE
from observer_rt.identification.discovery.search.verdict import consequence
from observer_rt.identification.likelihood.bounded_fit import Minimum, fit
from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import TermLaw, form_freed, form_settled, term_effect
from observer_rt.model.terms.term import TermEquation

_PAIRS = (
    {TermEquation.LINE_FLOW, TermEquation.INERTANCE},
    {TermEquation.LINE_FLOW, TermEquation.RAIL_PRESSURE},
    {TermEquation.SEAT_FLOW, TermEquation.NEEDLE_LIFT},
    {TermEquation.SEAT_FLOW, TermEquation.NOZZLE_FLOW},
    {TermEquation.NOZZLE_FLOW, TermEquation.CHAMBER_PRESSURE},
    {TermEquation.LINE_PRESSURE, TermEquation.NEEDLE_LIFT},
    {TermEquation.LINE_PRESSURE_SENSOR, TermEquation.RAIL_PRESSURE},
    {TermEquation.LINE_PRESSURE_SENSOR, TermEquation.NEEDLE_LIFT},
    {TermEquation.STIFFNESS, TermEquation.INERTANCE},
)
"""Equations of which some laws do the same to the line pressure, or nearly."""
_PROMISES = (
    0.5  # of the proposal's gain, that a law of the same numbers must have for these to be fitted, too
)


def with_alternatives(
    proposals: Sequence[Proposal], likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Proposal, ...]:
    """Proposals of one law, with what laws of the same form in another equation explain as well.

    Equations that have a proposal of their own are left out.
    """
    proposed = {term.equation for one in proposals for term in one.terms}
    return tuple(
        replace(one, alternatives=_alternatives(one, proposed, likelihood, nominal)) for one in proposals
    )


def exchanged(one: Proposal, number: int, equation: str, nominal: EffectiveModel) -> Proposal:
    """A proposal with the law of another equation, which line pressure cannot tell from it, in its place.

    number: of the proposal. Raises `UserError` for an equation of which there is no such law.
    """
    by_equation = {str(other.terms[0].equation): other for other in one.alternatives}
    if equation not in by_equation:
        there = f"there are laws of {', '.join(by_equation)}" if by_equation else "there is no other law"
        raise UserError(
            f"--instead {equation}",
            f"line pressure tells that from proposal {number}: {there}",
            "leave it out, or see the report",
        )
    other = by_equation.pop(equation)
    return replace(
        one,
        found=other,
        gain=one.gain + one.found.statistic - other.statistic,
        unsound=unsound(other.model(nominal), nominal),
        held_out=(math.nan, math.nan),
        curves=(),
        lost=(),
        alternatives=(one.found, *by_equation.values()),
    )


def _alternatives(
    one: Proposal, proposed: set[TermEquation], likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Candidate, ...]:
    (effect, *further), found = one.found.hypothesis.effects, []
    law = effect.apply
    if further or not isinstance(law, TermLaw):
        return ()
    measured = [recorded.measurement for recorded in likelihood.recordings]
    for equation in TermEquation:
        if {law.equation, equation} in _PAIRS and equation not in proposed:
            other = term_effect(equation, law.form, law.numbers)
            fitted = _fitted(other, one, likelihood, nominal)
            if fitted is not None:
                moves = consequence(measured, nominal, fitted.model(nominal))
                found.append(replace(fitted, moves=moves))
    return tuple(found)


def _fitted(
    effect: Effect, beside: Proposal, likelihood: JointLikelihood, nominal: EffectiveModel
) -> Candidate | None:
    """A law fitted, its own numbers, too; None where it does not explain as much as the proposal beside."""

    def fitted(hypothesis: Hypothesis, start: Sequence[float]) -> Minimum | None:
        return fit(Sizing(likelihood, nominal, hypothesis), np.array(start), hypothesis.ranges())

    alone = Hypothesis((effect,))
    found = fitted(alone, (0.0,))
    if found is None or beside.found.statistic + _PROMISES * beside.gain < found.residuals.statistic:
        return None
    freed = Hypothesis((form_freed(effect),))
    if len(freed.parameters) > 1:
        starts = [one.starts[0] for one in freed.parameters[1:]]
        shaped = fitted(freed, (*found.theta, *starts))
        if shaped is not None:
            alone = Hypothesis((form_settled(effect, shaped.theta[1:].tolist()),))
            found = fitted(alone, shaped.theta[:1].tolist()) or found
    residuals = found.residuals
    spread = max(1.0, residuals.squares / residuals.z.size)
    if residuals.statistic > beside.found.statistic + TIE * spread:
        return None
    return Candidate.fitted(alone, found.theta, residuals.statistic, found.sigmas())
