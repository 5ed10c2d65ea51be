"""Recordings of a simulated injector with effects hidden in it, for the tests of discovery."""

from collections.abc import Sequence

from observer_rt.config.bench import load_injector
from observer_rt.desk.simulation.simulate import SimulatedNoise
from observer_rt.engine.estimation.phases import Phase
from observer_rt.files.signals.recording import Recording
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.proposal import Proposal, Refusal
from observer_rt.identification.likelihood.likelihood import JointLikelihood
from observer_rt.model.effect import Component, Effect, SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.terms.term import Term
from tests.identification.fit.healthy import simulations

NOMINAL = load_injector()
MODEL = effective_model(NOMINAL)
POINTS = ((60e6, 1.9e-3), (140e6, 0.6e-3))


def recordings(
    effects: Sequence[SizedEffect] = (),
    measured_rate: bool = False,
    parameters: InjectorParameters = NOMINAL,
    points: Sequence[tuple[float, float]] = POINTS,
    noise: SimulatedNoise | None = SimulatedNoise(),  # noqa: B008
    seed: int = 1,
) -> list[Recording]:
    """One recording an operating point (rail pressure [Pa], energizing [s]), two injections in each."""
    made = simulations(points, parameters, measured_rate, 2, seed, noise, effects, period=0.06)
    return [simulation.recording for simulation in made]


def statistic_of(likelihood: JointLikelihood, *effects: SizedEffect, model: EffectiveModel = MODEL) -> float:
    for effect in effects:
        model = effect.effect.apply(model, effect.values)
    residuals = likelihood.residuals(model)
    assert residuals is not None
    return residuals.statistic


def proposal_of(*effects: Effect, adequate: bool = True, unsound: Refusal | None = None) -> Proposal:
    """Of effects and laws, all 0.1 in size."""
    result = Candidate(Hypothesis(effects), (0.1,) * len(effects), 0.0, half=(0.01,) * len(effects))
    return Proposal(result, 0.0, Phase.OPEN, adequate, unsound, (0.0, 0.0))


def effect_of(term: Term) -> Effect:
    """A term as an effect without a size, so that recordings can be simulated with it."""
    return Effect(str(term), Component.LINE_FLOW, (), lambda model, _: model.with_term(term), "", "")
