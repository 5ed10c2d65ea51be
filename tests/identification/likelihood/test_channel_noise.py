"""Noise of lift and rail pressure on its way into the innovations."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.desk.simulation.simulate import SimulatedNoise
from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.true_inputs import LAG_GRID, LiftNoise, true_rail_pressure
from observer_rt.model.effects import sized
from tests.identification.discovery.hidden import MODEL, recordings, statistic_of
from tests.observed_plants import recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, Surroundings, record

STARTS = (0.02, 0.05, 0.08)
AT_REST = measurements(recordings(points=((100e6, 1.0e-3),)))[0]
LOUD = SimulatedNoise(line_pressure=2e4, needle_lift=1.5e-6)


def _supply(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """A rail that dips by 1.2 MPa with every injection, and ripples."""
    rail = 0.2e6 * np.sin(2.0 * np.pi * 230.0 * time)
    for start in STARTS:
        after = np.maximum(time - start, 0.0)
        rail -= 1.2e6 * np.minimum(after / 2e-3, 1.0) * np.exp(-np.maximum(after - 2e-3, 0.0) / 5e-3)
        rail += 0.3e6 * np.sin(2.0 * np.pi * 900.0 * after) * np.exp(-after / 4e-3)
    return rail


@pytest.fixture(scope="module")
def moving() -> tuple[Measurement, ...]:
    """A healthy injector, recorded where the rail moves."""
    results = []
    for number, pressure in enumerate((60e6, 140e6)):
        events = tuple(Event(pressure, (Shot(0.0, 1.2e-3),), Faults()) for _ in STARTS)
        around = Surroundings(starts=STARTS, supply=(_supply,))
        bench = Bench(Injector(), Needle(), events, seed=30 + number, around=around)
        results.append(recording_of(record(bench)))
    return measurements(results)


@given(share=st.floats(0.0, 1.0))
def test_as_much_noise_is_left_at_every_share_of_a_sample(share: float) -> None:
    rng = np.random.default_rng(1)
    rail = 1e8 + rng.normal(0.0, 1e5, AT_REST.recording.samples)
    rail += np.where(np.arange(rail.size) < rail.size // 2, 0.0, 1e6)  # so that it counts as moving
    noisy = replace(AT_REST, recording=replace(AT_REST.recording, rail_pressure=rail))
    events = (replace(AT_REST.events[0], start=0, end=rail.size),)
    part = slice(200, rail.size // 2 - 200)
    levels = [np.std(true_rail_pressure(replace(noisy, events=events), delay)[part]) for delay in (0.0, 1e-5 * share)]
    assert levels[1] == pytest.approx(levels[0], rel=0.02)


def test_a_parabola_passes_as_it_is_and_a_gap_beside_it_does_no_harm() -> None:
    time = AT_REST.recording.time
    parabola = 1e8 + 1e10 * time + 1e11 * time**2
    moved = replace(AT_REST, recording=replace(AT_REST.recording, rail_pressure=parabola))
    inside = slice(30, -30)
    assert true_rail_pressure(moved, 0.0)[inside] == pytest.approx(parabola[inside], rel=1e-7)
    parabola[100:103] = np.nan
    assert np.isfinite(true_rail_pressure(moved, 13e-6)).all()


def test_a_healthy_injector_s_rail_was_recorded_in_time(moving: tuple[Measurement, ...]) -> None:
    """-2 log L over the delay is lowest at 0, within its interval, whatever the share of a sample."""
    likelihood = joint_likelihood(moving, MODEL)
    delays = np.arange(-40.0, 40.1, 2.5)
    statistic = [statistic_of(likelihood, sized("rail_pressure_skew", d=1e-6 * delay)) for delay in delays]
    gained = statistic[delays.size // 2] - np.array(statistic)
    assert np.max(gained) < 9.0  # 3 standard deviations
    assert np.max(gained[np.abs(delays) > 20.0]) < -9.0  # and a false delay is refuted


def test_a_lag_undone_by_a_lead_explains_nothing(moving: tuple[Measurement, ...]) -> None:
    """Together they only smooth the prediction: once the noise is separated, that gains nothing."""
    likelihood = joint_likelihood(moving, MODEL)
    before = statistic_of(likelihood)
    for tau in (2e-6, 5e-6, 8e-6, 13e-6):
        both = sized("line_pressure_sensor_lag", tau=tau), sized("channel_skew", d=-tau)
        assert before - statistic_of(likelihood, *both) < 16.0


def test_what_is_found_is_the_variance_beyond_that_without_a_lag() -> None:
    (measurement,) = measurements(recordings(points=((100e6, 1e-3),)))
    noise = measurement.noise.needle_lift

    def innovations(measurement: Measurement, lag: float) -> NDArray[np.float64]:
        return (1.0 + lag / LAG_GRID) * measurement.recording.needle_lift / noise

    result = LiftNoise(measurement, innovations)
    assert np.mean(result.variance(2 * LAG_GRID)) == pytest.approx(9.0 - 1.0, rel=0.05)
    assert np.mean(result.variance(2.5 * LAG_GRID)) == pytest.approx(0.5 * (9.0 + 16.0) - 1.0, rel=0.05)
    assert not result.variance(0.0).any()


def test_the_noise_of_a_restored_lift_speaks_less_against_the_model() -> None:
    lag = sized("needle_lift_sensor_lag", tau=40e-6)
    likelihood = joint_likelihood(measurements(recordings((lag,), True, noise=LOUD)), MODEL)
    judged = likelihood.judge(lag.effect.apply(MODEL, lag.values))
    assert judged is not None
    for recorded, judged_model in zip(likelihood.recordings, judged, strict=True):
        moving = (recorded.phases == Phase.OPENING) | (recorded.phases == Phase.CLOSING)
        assert np.mean(judged_model.z[moving] ** 2) < 2.0  # 3.0 were the lift taken to be as quiet as it was recorded
        assert np.mean(judged_model.rate_z**2) < 0.95  # 1.0 and 1.1, likewise
