"""Where model and measurement disagree: signal by phase by operating point, before and after."""

from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt.discovery.result import Cell, Discovery, Verdict
from observer_rt.estimation.phases import Phase
from observer_rt.model.effect import Equation
from observer_rt.model.effects import VOCABULARY

SIGNIFICANT = 5.0  # standard deviations
PHASE_NAMES = {
    Phase.STANDSTILL: "closed",
    Phase.OPENING: "opening",
    Phase.OPEN: "open",
    Phase.CLOSING: "closing",
    Phase.AFTER: "after",
}


@dataclass(frozen=True)
class Disagreement:
    """One signal in one phase of one recording, with the nominal model and with the winner of the search.

    equation: which is violated; None where the nominal model does not disagree significantly.
    """

    before: Cell
    after: Cell
    equation: Equation | None


def disagreements(found: Discovery) -> tuple[Disagreement, ...]:
    """The map of disagreement, in the order of the recordings."""
    after = {(cell.signal, cell.phase, cell.recording): cell for cell in found.after}
    return tuple(
        Disagreement(
            cell,
            after.get((cell.signal, cell.phase, cell.recording), cell),
            _equation(found) if cell.excess > SIGNIFICANT else None,
        )
        for cell in found.before
    )


def _equation(found: Discovery) -> Equation | None:
    """The equation the search holds responsible."""
    if found.verdict is Verdict.UNKNOWN:
        return found.unexplained.equation if found.unexplained is not None else None
    strongest: Sequence[str] = [effect.id for effect in sorted(found.effects, key=lambda e: -e.gain)]
    return VOCABULARY[strongest[0]].equation if strongest else None
