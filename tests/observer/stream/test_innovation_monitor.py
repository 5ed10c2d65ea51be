"""When innovations have left what noise can do."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from observer_rt.foundation.continuity import Doubt
from observer_rt.observer.learning.adequacy import Objection
from observer_rt.observer.learning.healthy import NOT_FITTED, Healthy
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.learning.learner import Learner
from observer_rt.observer.mailbox import judge
from observer_rt.observer.observer import Durations, constants_for, make_observer
from observer_rt.observer.stream.pair import end_contradiction, watch
from observer_rt.observer.stream.state import Reason
from tests.observer.sample_stream import NOISE, NOMINAL, Stream

SIGMA = 0.002  # of p_0


def memory() -> Any:
    """As of an observer that runs, between two events."""
    return SimpleNamespace(
        innovation_weight=1.0 / SIGMA**2,
        surprise=0.0,
        synchronised=True,
        contradicted=False,
        contradicted_in=-1,
        doubted=0,
        in_event=False,
        event_number=7,
    )


def contradicted_at(scores: ArrayLike, of: Any, doubt: Doubt = Doubt.NONE) -> int | None:
    """Number of the innovation [standard deviations] with which the contradiction is seen."""
    observer = SimpleNamespace(memory=[of])
    for k, score in enumerate(np.atleast_1d(np.asarray(scores, float))):
        watch.py_func(observer, SIGMA * float(score), int(doubt))
        if of.contradicted:
            return k
    return None


def test_white_noise_contradicts_nothing() -> None:
    assert contradicted_at(np.random.default_rng(3).normal(size=50_000), memory()) is None


def test_three_spikes_contradict_nothing() -> None:
    spikes = np.random.default_rng(4).normal(size=2000)
    spikes[100::200] = 50.0
    spikes[101::200] = -50.0
    spikes[102::200] = 50.0
    assert contradicted_at(spikes, memory()) is None


@pytest.mark.parametrize("period", [3, 12, 10_000])
def test_a_line_that_swings_otherwise_contradicts_soon(period: int) -> None:
    """Innovations of both signs do not make up for each other."""
    swing = 4.0 * np.cos(2.0 * np.pi * np.arange(40) / period)
    found = contradicted_at(swing, memory())
    assert found is not None
    assert found < 16


def test_it_lasts_until_an_event_that_can_tell() -> None:
    shut, opened = memory(), memory()
    opened.in_event = True
    assert contradicted_at([6.0] * 20, shut) is not None
    assert contradicted_at([6.0] * 20, opened) is not None
    assert (shut.contradicted_in, opened.contradicted_in) == (8, 7)


def test_what_is_not_to_be_trusted_contradicts_nothing() -> None:
    assert contradicted_at([9.0] * 100, memory(), Doubt.TIME_BASE) is None
    doubted = memory()
    doubted.doubted = 16
    assert contradicted_at([9.0] * 100, doubted) is None


@pytest.mark.parametrize(
    ("healthy", "contradicts"), [(NOT_FITTED, True), (Healthy(live_variance=9.0), False)]
)
def test_what_a_fitted_model_leaves_of_a_healthy_injector_is_no_contradiction(
    healthy: Healthy, contradicts: bool
) -> None:
    constants = constants_for(NOMINAL, 100e3, Durations(), 2)
    knowledge = no_knowledge(NOISE, constants.coefficients.pressure_scale)
    learner = Learner(constants, knowledge)
    observer = make_observer(constants, knowledge, learner, healthy)
    scale = learner.schedule.innovation_sigma / SIGMA
    record = observer.memory.view(np.recarray)[0]
    record.synchronised = True
    swing = 3.0 * scale * np.cos(2.0 * np.pi * np.arange(100) / 10_000)
    assert (contradicted_at(swing, record) is not None) == contradicts


@pytest.mark.parametrize(("resting", "ends"), [(True, True), (False, False)])
def test_a_contradiction_at_rest_is_over_when_the_channel_is_well_again(resting: bool, ends: bool) -> None:
    constants = constants_for(NOMINAL, 100e3, Durations(), 2)
    of = memory()
    of.contradicted, of.contradicted_at_rest, of.calm = True, False, 0
    observer = SimpleNamespace(memory=[of], constants=constants)
    end_contradiction.py_func(observer, resting, True)
    assert of.contradicted
    for score in np.random.default_rng(1).normal(size=2 * constants.timing.good):
        if of.contradicted:
            watch.py_func(observer, SIGMA * score, 0)
            end_contradiction.py_func(observer, resting, False)
    assert of.contradicted is not ends


@pytest.mark.parametrize(
    ("event", "doubtful", "lasts"),
    [(7, Reason.INPUT_FROZEN, False), (7, Reason.NONE, True), (6, Reason.INPUT_FROZEN, True)],
)
def test_what_contradicted_in_an_event_of_doubtful_samples_is_over_with_it(
    event: int, doubtful: Reason, lasts: bool
) -> None:
    observer = Stream().observer
    of = observer.memory[0]
    of["events"][0]["number"], of["events"][0]["doubtful"] = event, doubtful
    of["contradicted"], of["contradicted_in"] = True, 7
    judge(observer, (Objection(Reason.NOT_JUDGED),), None)
    assert bool(of["contradicted"]) is lasts
