"""The map of disagreement: where models and recordings differ, and the equation that is violated there."""

from dataclasses import dataclass

from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT_EXCESS, cells_of
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.results import Cell, CellKey, Discovery
from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.model.effect import Component, Effect, Equation
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import LineOutflow


@dataclass(frozen=True)
class Disagreement:
    """A cell of the map with the nominal model, and with what was found or is nearest."""

    before: Cell
    after: Cell
    equation: Equation | None  # violated; None where `before` does not disagree significantly, or nobody knows


def disagreements(
    discovery: Discovery, shown: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Disagreement, ...]:
    """The map, in the order of the recordings. shown: what was found; if nothing, the nearest candidate counts."""
    cells = discovery.after
    if shown.ids != discovery.best.ids and shown.ids:
        model = shown.model(nominal)
        judged = likelihood.judge(model)
        cells = () if judged is None else cells_of(likelihood, judged, model)
    after = {cell.key: cell for cell in cells}
    equations = _equations(discovery, shown, likelihood, nominal)
    result = []
    for cell in discovery.before:
        equation = equations.get(cell.key) if cell.excess > SIGNIFICANT_EXCESS else None
        result.append(Disagreement(cell, after.get(cell.key, cell), equation))
    return tuple(result)


def _equations(
    discovery: Discovery, shown: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> dict[CellKey, Equation]:
    """For every cell the equation of that effect without which the cell is explained worst."""
    if not shown.ids and discovery.unexplained is not None:
        return {cell.key: discovery.unexplained.equation for cell in discovery.before}
    worst: dict[CellKey, tuple[float, Equation]] = {}
    for effect in shown.hypothesis.effects:
        others, sizes = shown.without(effect)
        model = others.model(nominal, sizes)
        judged = likelihood.judge(model)
        for cell in discovery.before if judged is None else cells_of(likelihood, judged, model):
            if cell.key not in worst or cell.variance > worst[cell.key][0]:
                worst[cell.key] = cell.variance, _violated(effect, nominal)
    return {key: equation for key, (_, equation) in worst.items()}


def _violated(effect: Effect, model: EffectiveModel) -> Equation:
    """The equation of a model that is violated while an effect is missing."""
    if effect.component is Component.NOZZLE and model.injector.line_outflow is LineOutflow.SEAT:
        return Equation.SAC_PRESSURE  # the nozzle flow is in no other
    return effect.equation
