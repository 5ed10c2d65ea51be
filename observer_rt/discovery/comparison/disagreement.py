"""Where model and measurement disagree: signal by phase by operating point, before and after."""

from dataclasses import dataclass

from observer_rt.discovery.search.adequacy import SIGNIFICANT, cells_of
from observer_rt.discovery.search.result import Cell, Discovery, Verdict
from observer_rt.estimation.phases import Phase
from observer_rt.evidence.likelihood import Evidence
from observer_rt.evidence.pooled import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effective import EffectiveModel

PHASE_NAMES = {
    Phase.STANDSTILL: "closed",
    Phase.OPENING: "opening",
    Phase.OPEN: "open",
    Phase.CLOSING: "closing",
    Phase.AFTER: "after",
}

_Key = tuple[Signal, Phase, int]


@dataclass(frozen=True)
class Disagreement:
    """One signal in one phase of one recording, with the nominal model and with the winner of the search.

    equation: which is violated; None where the nominal model does not disagree significantly, or nobody knows.
    """

    before: Cell
    after: Cell
    equation: Equation | None


def disagreements(found: Discovery, evidence: Evidence, nominal: EffectiveModel) -> tuple[Disagreement, ...]:
    """The map of disagreement, in the order of the recordings."""
    after = {_key(cell): cell for cell in found.after}
    equations = _equations(found, evidence, nominal)
    result = []
    for cell in found.before:
        equation = equations.get(_key(cell)) if cell.excess > SIGNIFICANT else None
        result.append(Disagreement(cell, after.get(_key(cell), cell), equation))
    return tuple(result)


def _equations(found: Discovery, evidence: Evidence, nominal: EffectiveModel) -> dict[_Key, Equation]:
    """Of every cell: the equation of that effect without which it is explained worst."""
    if found.verdict is Verdict.UNKNOWN and found.unexplained is not None:
        return {_key(cell): found.unexplained.equation for cell in found.before}
    worst: dict[_Key, tuple[float, Equation]] = {}
    for number, effect in enumerate(found.named.hypothesis.effects):
        others = found.named.model_without(number, nominal)
        judged = evidence.judge(others)
        for cell in found.before if judged is None else cells_of(evidence, judged, others):
            key, loss = _key(cell), cell.variance
            if key not in worst or loss > worst[key][0]:
                worst[key] = loss, effect.equation
    return {key: equation for key, (_, equation) in worst.items()}


def _key(cell: Cell) -> _Key:
    return cell.signal, cell.phase, cell.recording
