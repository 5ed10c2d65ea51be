"""Proposals that leave something: whether a model may have them in part, what they leave being its uncertainty."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.search.results import Cell, Part, Proposal, Refusal
from observer_rt.identification.likelihood.likelihood import JointLikelihood, Signal
from observer_rt.identification.likelihood.open_loop import consequence, mean_mass
from observer_rt.model.baseline import PhaseFigures
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.terms.law import Number
from observer_rt.model.terms.term import Term, TermEquation

LEAST_CLOSED = 2.0 / 3.0  # of the gap held out
# So small that pressure and mass follow it in proportion.
_PROBE = Term(TermEquation.NOZZLE_FLOW, Number(0.02))
_MORE = "record more rail pressures and durations, or the injection rate as well"


def with_parts(
    proposals: Sequence[Proposal], likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Proposal, ...]:
    """Proposals, with what may be accepted of those that leave something but have no other objection."""
    return tuple(map(_ProposalJudge(proposals, likelihood, nominal).with_part, proposals))


class _ProposalJudge:
    """Proposals beside each other."""

    def __init__(
        self, proposals: Sequence[Proposal], likelihood: JointLikelihood, nominal: EffectiveModel
    ) -> None:
        self._proposals = proposals
        self._likelihood = likelihood
        self._nominal = nominal
        self._measured = [recorded.measurement for recorded in likelihood.recordings]

    def with_part(self, proposal: Proposal) -> Proposal:
        if proposal.adequate or proposal.objection is not None or math.isnan(proposal.held_out[0]):
            return proposal
        noise = float(np.mean([each.noise.line_pressure**2 for each in self._measured]))
        before, after = (math.sqrt(max(gap**2 - noise, 0.0)) for gap in proposal.held_out)
        if not before > 0.0:
            return proposal
        half = self._mass_half(proposal, after)
        closed = 1.0 - after / before
        return replace(proposal, part=Part(closed, after, half, self._refusal(proposal, closed, half)))

    def _refusal(self, proposal: Proposal, closed: float, half: float) -> Refusal | None:
        if closed < LEAST_CLOSED:
            return Refusal(f"it closes {max(closed, 0.0):.0%} of the gap held out, not two thirds", _MORE)
        interval = half * mean_mass(self._measured, proposal.model(self._nominal))
        rivals = [other for other in self._proposals if other is not proposal]
        moved = [each.candidate.moves.mass - proposal.candidate.moves.mass for each in rivals]
        differs = max(moved, key=abs, default=0.0)
        if abs(differs) > interval:
            return Refusal(
                f"a law of another equation that explains as much would inject {differs / MILLIGRAM:+.2g} mg, beyond "
                f"the interval of ±{interval / MILLIGRAM:.2g} mg",
                "measure the injection rate or the mass",
            )
        return None

    def _mass_half(self, proposal: Proposal, left: float) -> float:
        """Half width of the 95 % interval of a mass, as a share: what a change of the nozzle would make of it that
        leaves as much in the line pressure."""
        model = proposal.model(self._nominal)
        moved = consequence(self._measured, model, model.with_term(_PROBE))
        return left / moved.line_pressure * abs(moved.mass) / mean_mass(self._measured, model)


def variance_by_phase(cells: Sequence[Cell]) -> PhaseFigures:
    """Mean square of the line pressure's normalised innovations by phase, of the recording with the most left."""
    worst: dict[str, float] = {}
    for cell in cells:
        if cell.signal is Signal.LINE_PRESSURE:
            name = Phase(cell.phase).name
            worst[name] = max(worst.get(name, 0.0), cell.variance)
    return PhaseFigures.of(worst)
