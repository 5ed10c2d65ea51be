"""Laws that explain recordings, as proposals: with intervals, consequences, gaps held out, and objections to them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from observer_rt.config.effects import term_domain
from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLIMETRE, MILLISECOND, MM3_PER_MS, Floats
from observer_rt.identification.discovery.search.adequacy import Adequacy, HeldOutPoints, worst
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.proposal import TOO_FREE, TOO_MANY, Part, Proposal, Refusal
from observer_rt.identification.discovery.search.results import INTERVAL_MARGIN, Cell, SearchOutcome
from observer_rt.identification.likelihood.bounded_fit import NORMAL_975
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import consequence, mean_mass, simulated
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.baseline import PhaseFigures
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.term_effect import is_term
from observer_rt.model.terms.bounds import refuse_unbounded
from observer_rt.model.terms.in_force import SeenRange
from observer_rt.model.terms.law import Number
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import VARIABLES, Variable

MARGIN = 0.1  # of the range of a pressure or speed, at both ends
FLOW_MARGIN = 1.25  # times the largest injection rate, that a flow may be, either way
_DIGITS = 4
_RATE = {"rail_pressure": "rail_pressure_rate", "line_pressure": "line_pressure_rate", "needle_lift": "lift_rate"}
LEAST_CLOSED = 2.0 / 3.0  # of the gap held out
_PROBE = Term(TermEquation.NOZZLE_FLOW, Number(0.02))  # So small that pressure and mass follow it in proportion.
_MORE = "record more rail pressures and durations, or the injection rate as well"


def proposals_of(
    laws: Sequence[Candidate], fitter: Fitter, outcome: SearchOutcome, healthy: Healthy, held_out: HeldOutPoints
) -> tuple[Proposal, ...]:
    """Proposals of laws that a search found; where the first has too many laws, the best of them alone, too."""
    if not laws:
        return ()
    nominal, adequate = fitter.nominal, Adequacy(fitter, healthy)
    measured = [recorded.measurement for recorded in fitter.likelihood.recordings]
    phase, seen = worst(fitter.pool(outcome.nominal), healthy).phase, seen_in(measured, nominal)
    before = held_out.gap(outcome.nominal)

    def proposal(candidate: Candidate) -> Proposal:
        half = NORMAL_975 * INTERVAL_MARGIN * fitter.sigmas(candidate)
        moves = consequence(measured, nominal, candidate.model(nominal))
        sized = replace(candidate, half=tuple(half.tolist()), moves=moves, sizes_of_half=held_out.sizes(candidate))
        gain, gap = outcome.nominal.statistic - candidate.statistic, (before, held_out.gap(candidate))
        verdict = adequate(candidate), unsound(candidate.terms, nominal, seen)
        lift, probability = nominal.injector.seat.max_lift, outcome.probability(candidate)
        return Proposal(sized, gain, phase, *verdict, gap, probability, seen, largest_lift=lift)

    made = [proposal(one) for one in laws]
    if not made[0].adequate and made[0].objection in (TOO_MANY, TOO_FREE):
        alone = [(Hypothesis((effect,)), sizes) for effect, sizes, _ in made[0].candidate.parts if is_term(effect)]
        made += [proposal(one) for one in sorted(fitter.laws(alone), key=attrgetter("price"))[:1]]
    return with_parts([replace(one, number=number) for number, one in enumerate(made, start=1)], measured, nominal)


def unsound(terms: Sequence[Term], nominal: EffectiveModel, seen: SeenRange) -> Refusal | None:
    """Objection to a model with these terms, their inputs held in the ranges seen; None for sound terms."""
    domain = term_domain(nominal.injector)
    try:
        for term in terms:
            refuse_unbounded(replace(term, law=term.law.held(seen)), domain)
    except UserError as error:
        return Refusal(f"{error.location} {error.problem}", error.remedy)
    return None


def seen_in(measured: Sequence[Measurement], model: EffectiveModel) -> SeenRange:
    """Ranges of pressures, flows, speeds and times in recordings, in the units of laws."""
    events = [(one, event) for one in measured for event in one.events]
    ranges = {Variable.INJECTION_NUMBER: (1.0, float(max(e.clock.injections + len(e.openings) for _, e in events)))}
    ranges[Variable.TIME] = (0.0, max(e.clock.time + (e.end - e.start) * one.interval for one, e in events))
    since = max((e.end - e.openings[-1].first) * one.interval for one, e in events)
    ranges[Variable.TIME_SINCE_OPENING] = (0.0, since / MILLISECOND)
    for name, unit in (("rail_pressure", MEGAPASCAL), ("line_pressure", MEGAPASCAL), ("needle_lift", MILLIMETRE)):
        values = [getattr(one.recording, name)[e.start : e.end] / unit for one, e in events]
        changes = [
            np.diff(each) * (MILLISECOND / one.interval) for each, (one, _) in zip(values, events, strict=True)
        ]
        ranges[VARIABLES[_RATE[name]]] = _widened(changes)
        low, high = _widened(values)
        ranges[VARIABLES[name]] = max(low, 0.0), high
    del ranges[Variable.NEEDLE_LIFT]  # laws hold up to the stop, seen or not
    ranges[Variable.SAC_PRESSURE] = 0.0, ranges[Variable.LINE_PRESSURE][1]
    flow = FLOW_MARGIN * max(float(np.max(run.rate)) for one in measured for run in simulated(one, model))
    for variable in (Variable.LINE_FLOW, Variable.SEAT_FLOW, Variable.NOZZLE_FLOW):
        ranges[variable] = -flow / MM3_PER_MS, flow / MM3_PER_MS
    return {
        variable: (float(f"{low:.{_DIGITS}g}"), float(f"{high:.{_DIGITS}g}"))
        for variable, (low, high) in ranges.items()
        if low < high
    }


def _widened(values: Sequence[Floats]) -> tuple[float, float]:
    low, high = (float(end(list(map(end, values)))) for end in (np.nanmin, np.nanmax))
    margin = MARGIN * (high - low)
    return low - margin, high + margin


def with_parts(
    proposals: Sequence[Proposal], measured: Sequence[Measurement], nominal: EffectiveModel
) -> tuple[Proposal, ...]:
    """Proposals, the inadequate ones without an objection with the part that may be accepted."""
    noise = float(np.mean([each.noise.line_pressure**2 for each in measured]))

    def with_part(proposal: Proposal) -> Proposal:
        before, after = (math.sqrt(max(gap**2 - noise, 0.0)) for gap in proposal.held_out)
        if proposal.adequate or proposal.objection is not None or not before > 0.0:
            return proposal
        model, closed = proposal.candidate.model(nominal), 1.0 - after / before
        mass, moved = mean_mass(measured, model), consequence(measured, model, model.with_term(_PROBE))
        # of the mass change by a nozzle that leaves as much in the line pressure
        half = after / moved.line_pressure * abs(moved.mass) / mass
        refusal = _refusal_in_part(proposal, proposals, closed, half * mass)
        return replace(proposal, part=Part(closed, after, half, refusal))

    return tuple(map(with_part, proposals))


def _refusal_in_part(
    proposal: Proposal, proposals: Sequence[Proposal], closed: float, interval: float
) -> Refusal | None:
    """Objection to accepting a proposal in part; closed: share of the gap; interval: half width of a mass [kg]."""
    if closed < LEAST_CLOSED:
        tenths = math.floor(1e3 * max(closed, 0.0)) / 10.0  # rounded up it might read as enough
        return Refusal(f"it closes {tenths:.1f}% of the gap held out, less than {LEAST_CLOSED:.1%}", _MORE)
    differs = max([each.candidate.moves.mass - proposal.candidate.moves.mass for each in proposals], key=abs)
    if abs(differs) > interval:
        return Refusal(
            f"a law of another equation that explains as much would inject {differs / MILLIGRAM:+.2g} mg, beyond "
            f"the interval of ±{interval / MILLIGRAM:.2g} mg",
            "measure the injection rate or the mass",
        )
    return None


def variance_by_phase(cells: Sequence[Cell]) -> PhaseFigures:
    """Mean square of the line pressure's normalised innovations by phase, of the recording with the largest."""
    worst: dict[str, float] = {}
    for cell in cells:
        if cell.signal is Signal.LINE_PRESSURE:
            name = Phase(cell.phase).name
            worst[name] = max(worst.get(name, 0.0), cell.variance)
    return PhaseFigures.of(worst)
