"""What the observer's x~ leaves of a healthy injector, and that learning does not take it for wear."""

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.healthy_events import observer_remainder
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.learning.healthy import KNOTS
from observer_rt.files.signals.recording import Recording
from observer_rt.model.baseline import HealthyRemainder
from observer_rt.model.effects import sized
from tests.baselines import baseline
from tests.identification.fit.healthy import POINTS, simulations
from tests.observed_plants import with_coloured_noise

NOMINAL = load_injector()
Rung = tuple[list[Recording], HealthyRemainder | None]
"""Recordings, and what the observer leaves of them."""
SWING = 0.6  # MPa, of what the model below leaves after an opening


def ringing(recording: Recording, seed: int) -> Recording:
    """The same injections with a line pressure that rings after each opening as no model knows, each differently."""
    random = np.random.default_rng(seed)
    open_now = recording.needle_lift > 20e-6
    pressure = recording.line_pressure.copy()
    for first in np.flatnonzero(open_now[1:] & ~open_now[:-1]):
        time = np.arange(150) * 1e-5
        size = SWING * random.normal(1.0, 0.2) * 1e6
        pressure[first : first + 150] += size * np.sin(time / 40e-6) * np.exp(-time / 0.3e-3)
    return Recording(recording.time, recording.rail_pressure, recording.needle_lift, pressure)


@pytest.fixture(scope="module")
def healthy() -> list[Recording]:
    return [one.recording for one in simulations(injections=4)]


@pytest.fixture(scope="module")
def rung(healthy: list[Recording]) -> Rung:
    recordings = [ringing(one, seed) for seed, one in enumerate(healthy)]
    return recordings, observer_remainder(NOMINAL, baseline(), recordings)


@pytest.mark.parametrize("is_filtered", [False, True])
def test_an_exact_model_leaves_noise(healthy: list[Recording], is_filtered: bool) -> None:
    """A filter makes noise louder than its steps from sample to sample say, which is no scatter of injections."""
    seen = [with_coloured_noise(one, seed) for seed, one in enumerate(healthy)] if is_filtered else healthy
    remainder = observer_remainder(NOMINAL, baseline(), seen)
    assert remainder is not None
    assert remainder.overdispersion < 1.2
    assert np.abs(remainder.shape.opening).max() < 0.1
    assert remainder.variance.open == pytest.approx(1.0, abs=0.3 if is_filtered else 0.2)


def test_what_comes_back_after_every_opening_is_found(rung: Rung) -> None:
    _, remainder = rung
    assert remainder is not None
    after = np.array(remainder.shape.opening)[(KNOTS > 0.0) & (KNOTS < 0.3e-3)]
    assert after.max() > 0.5 * SWING


def test_recordings_without_injections_say_nothing(healthy: list[Recording]) -> None:
    recording = healthy[0]
    still = Recording(
        recording.time, recording.rail_pressure, np.zeros_like(recording.needle_lift), recording.rail_pressure
    )
    assert observer_remainder(NOMINAL, baseline(), [still]) is None


def test_injections_that_differ_beyond_noise_are_overdispersed() -> None:
    """Every recording of another nozzle, by 4 %: no mean course explains that."""
    recordings = [
        simulate(
            NOMINAL,
            make_schedule([pressure], 3, 0.05, [duration]),
            100e3,
            (sized("orifice_area", v_H=0.04 if number % 2 else -0.04),),
            SimulatedNoise(),
            seed=number,
        ).recording
        for number, (pressure, duration) in enumerate(POINTS)
    ]
    remainder = observer_remainder(NOMINAL, baseline(), recordings)
    assert remainder is not None
    assert remainder.overdispersion > 1.5


@pytest.mark.parametrize("is_known", [False, True])
def test_what_a_model_leaves_of_the_healthy_is_not_held_against_it(rung: Rung, is_known: bool) -> None:
    (recordings, left), stated = rung, baseline()
    if is_known:
        stated = stated.model_copy(update={"observer": left})
    bench = load_bench().exact.with_parameters(NOMINAL.model_copy(update={"baseline": stated}))
    history = evaluate(bench, recordings)
    results = [one for each in history.evaluations for one in each.injections][4:]
    assert np.mean([one.valid for one in results]) == pytest.approx(1.0 if is_known else 0.0, abs=0.1)
    if is_known:
        shares = [one.mass / one.nominal_mass - 1.0 for one in results]
        assert np.abs(shares).max() < 0.018  # of the first at a new pressure
        assert np.sort(np.abs(shares))[-2] < 0.009
