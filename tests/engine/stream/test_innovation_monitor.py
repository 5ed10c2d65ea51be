"""When innovations have left what noise can do."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.knowledge import no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.observer import Durations, constants_for, make_observer
from observer_rt.engine.stream.state import Doubt, Observer, Reason
from tests.engine.sample_stream import NOISE, NOMINAL, Stream, at_rest, judge

SIGMA = 0.002  # of p_0


def running() -> Observer:
    observer = Stream().observer
    of = observer.memory[0]
    of["innovation_noise"]["weight"], of["synchronisation"]["synchronised"] = 1.0 / SIGMA**2, True
    of["event"]["number"] = 7
    return observer


def contradicted_at(scores: ArrayLike, observer: Observer, doubt: Doubt = Doubt.NONE) -> int | None:
    """Number of the innovation [standard deviations] with which the contradiction is seen."""
    for k, score in enumerate(np.atleast_1d(np.asarray(scores, float))):
        observer.stream.watch(SIGMA * float(score), int(doubt))
        if observer.memory[0]["monitor"]["contradicted"]:
            return k
    return None


def test_white_noise_and_three_spikes_contradict_nothing() -> None:
    spikes = np.random.default_rng(3).normal(size=50_000)
    for k, value in enumerate((50.0, -50.0, 50.0)):
        spikes[20_100 + k :: 200] = value
    assert contradicted_at(spikes, running()) is None


@pytest.mark.parametrize("period", [3, 12, 10_000])
def test_a_line_that_swings_otherwise_contradicts_soon(period: int) -> None:
    """Innovations of both signs do not make up for each other."""
    result = contradicted_at(4.0 * np.cos(2.0 * np.pi * np.arange(40) / period), running())
    assert result is not None
    assert result < 16


def test_it_lasts_until_an_event_that_can_tell() -> None:
    shut, opened = running(), running()
    opened.memory["event"]["in_event"] = True
    assert contradicted_at([6.0] * 20, shut) is not None
    assert contradicted_at([6.0] * 20, opened) is not None
    assert [int(each.memory[0]["monitor"]["contradicted_in"]) for each in (shut, opened)] == [8, 7]


def test_what_is_not_to_be_trusted_contradicts_nothing() -> None:
    assert contradicted_at([9.0] * 100, running(), Doubt.TIME_BASE) is None
    at_fault = running()
    at_fault.memory["input_fault"] = 16
    assert contradicted_at([9.0] * 100, at_fault) is None


@pytest.mark.parametrize(("healthy", "contradicts"), [(NOT_FITTED, True), (Healthy(live_variance=9.0), False)])
def test_what_a_fitted_model_leaves_of_the_healthy_is_no_contradiction(healthy: Healthy, contradicts: bool) -> None:
    constants = constants_for(NOMINAL, 100e3, Durations(), 2)
    knowledge = no_knowledge(NOISE, constants.coefficients.pressure_scale)
    learner = Learner(constants, knowledge)
    observer = make_observer(constants, knowledge, learner, healthy)
    scale = learner.schedule.innovation_sigma / SIGMA
    observer.memory["synchronisation"]["synchronised"] = True
    swing = 3.0 * scale * np.cos(2.0 * np.pi * np.arange(100) / 10_000)
    assert (contradicted_at(swing, observer) is not None) == contradicts


@pytest.mark.parametrize(("resting", "ends"), [(True, True), (False, False)])
def test_a_contradiction_at_rest_is_over_when_the_channel_is_well_again(resting: bool, ends: bool) -> None:
    observer = running()
    monitor, stream = observer.memory[0]["monitor"], observer.stream
    monitor["contradicted"] = True
    stream.end_contradiction(resting, True)
    assert monitor["contradicted"]
    for score in np.random.default_rng(1).normal(size=2 * observer.constants.timing.good):
        if monitor["contradicted"]:
            stream.watch(SIGMA * score, 0)
            stream.end_contradiction(resting, False)
    assert bool(monitor["contradicted"]) is not ends


@pytest.mark.parametrize(("fall", "count"), [(5e6, 2), (2e6, 0)])
def test_falls_as_by_injections_are_counted_where_the_lift_shows_none(fall: float, count: int) -> None:
    rail, lift, line = at_rest(np.random.default_rng(5), 20_000)
    for start in (8000, 14_000):
        line[start : start + 100] -= fall
    stream = Stream(events_required=0)
    stream.observer.memory["innovation_noise"]["weight"] = 1.0 / SIGMA**2
    assert stream.feed(rail, lift, line).count("monitor", "falls") == count


@pytest.mark.parametrize(
    ("event", "fault", "lasts"),
    [(7, Reason.INPUT_FROZEN, False), (7, Reason.NONE, True), (6, Reason.INPUT_FROZEN, True)],
)
def test_what_contradicts_in_an_event_of_doubt_is_over_with_it(event: int, fault: Reason, lasts: bool) -> None:
    observer = Stream().observer
    monitor = observer.memory[0]["monitor"]
    observer.events[0]["number"], observer.events[0]["fault"] = event, fault
    monitor["contradicted"], monitor["contradicted_in"] = True, 7
    judge(observer, (Objection(Reason.NOT_JUDGED),), None)
    assert bool(monitor["contradicted"]) is lasts
