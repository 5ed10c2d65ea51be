"""Rivals that a discovery leaves, and the measurement that would decide between them."""

import os
from collections.abc import Callable, Sequence
from functools import partial

from observer_rt.engine.learning.healthy import Healthy
from observer_rt.identification.discovery.search.outcome import probabilities
from observer_rt.identification.discovery.search.results import Candidate, Discovery, Verdict
from observer_rt.identification.discovery.words.sentences import candidate_words, proposal_words
from observer_rt.identification.likelihood.appearance import with_healthy_offset
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.planning.plan import MeasurementPlan, Planner, SimulateInjections, points_for
from observer_rt.identification.planning.separation import Rival, known_of
from observer_rt.model.effective import EffectiveModel


def next_measurement(
    discovery: Discovery,
    measured: Sequence[Measurement],
    nominal: EffectiveModel,
    healthy: Healthy,
    simulate: SimulateInjections,
    progress: Callable[[float], None],
) -> MeasurementPlan | None:
    """Plans what to measure next after a discovery in recordings; None where the answer is not ambiguous.

    healthy: what the model leaves of the healthy injector; progress is given the share done.
    """
    if discovery.verdict is not Verdict.AMBIGUOUS:
        return None
    rivals = rivals_of(discovery, nominal)
    measured = [with_healthy_offset(one, healthy) for one in measured]
    known_recordings = known_of(measured, joint_likelihood(measured, nominal, healthy.shape), rivals)
    planner = Planner(
        rivals, nominal, known_recordings, simulate, lambda behind: probabilities([0.0, *behind])[0]
    )
    return planner.plan(points_for(measured), len(os.sched_getaffinity(0)), progress)


def rivals_of(discovery: Discovery, nominal: EffectiveModel) -> list[Rival]:
    """Explanations that an ambiguous answer leaves, the leading one first."""
    tied = (discovery.named.ids, *discovery.rivals)
    left = [(_words(one), one) for ids in tied for one in discovery.ranking if one.ids == ids]
    left += [(proposal_words(one), one.candidate) for one in discovery.proposals]
    return [
        Rival(
            words,
            partial(one.hypothesis.model, nominal),
            one.theta,
            one.hypothesis.ranges(),
            one.price - left[0][1].price,
        )
        for words, one in left
    ]


def _words(candidate: Candidate) -> str:
    return candidate_words(candidate) if candidate.ids else "the model as it is"
