"""-2 log L of effective models on recordings of a simulated injector; for every effect a result, no exception."""

import gc
import tracemalloc
import weakref
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.identification.likelihood.appearance import healthy_remainder
from observer_rt.identification.likelihood.likelihood import JointLikelihood, RecordingLikelihood, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.open_loop import GAIN_ERROR, simulated
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from observer_rt.model.wave_line import with_cells
from tests.identification.discovery.hidden import MODEL, NOMINAL, recordings, statistic_of

HEALTHY = joint_likelihood(measurements(recordings(measured_rate=True)), MODEL)
RATES = (20e3, 50e3, 100e3, 200e3)


def test_innovations_and_rate_residuals_of_the_true_model_are_white() -> None:
    judged = HEALTHY.judge(MODEL)
    assert judged is not None
    z = np.concatenate([one.z for one in judged])
    rate = np.concatenate([one.rate_z for one in judged])
    assert np.mean(z**2) == pytest.approx(1.0, abs=0.06)
    assert np.mean(z[1:] * z[:-1]) == pytest.approx(0.0, abs=0.04)
    assert np.mean(rate**2) == pytest.approx(1.0, abs=0.15)


def test_many_models_take_little_memory() -> None:
    """Of each a row of gains is kept, and a likelihood that nobody needs any more is gone at once."""
    likelihood = RecordingLikelihood(measurements(recordings())[0], MODEL)
    tracemalloc.start()
    for stiffness in np.linspace(0.9, 1.1, 50):
        likelihood.judge(effective_model(NOMINAL, (sized("bulk_modulus", r=float(stiffness) - 1.0),)))
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept < 0.4e6
    here = weakref.ref(likelihood)
    gc.disable()
    del likelihood
    gc.enable()
    assert here() is None


@pytest.mark.parametrize(
    "hidden",
    [
        sized("orifice_area", v_H=0.05),
        sized("lift_offset", x_0=15e-6),
        sized("line_pressure_sensor_lag", tau=15e-6),
        sized("channel_skew", d=13e-6),
        sized("channel_skew", d=-24e-6),
        sized("rail_pressure_sensor_gain", g=0.005),
        sized("entrained_air", g=1e-3),
        sized("chamber_pressure_rise", dp=5e6),
    ],
    ids=lambda effect: str(effect.effect.id),
)
def test_the_truth_explains_far_more_than_the_nominal_model(hidden: SizedEffect) -> None:
    likelihood = joint_likelihood(measurements(recordings((hidden,))), MODEL)
    true = effective_model(NOMINAL, (hidden,))
    residuals = likelihood.residuals(true)
    assert residuals is not None
    assert np.mean(residuals.z**2) == pytest.approx(1.0, abs=0.06)
    assert residuals.statistic < statistic_of(likelihood) - 300.0


def test_a_gain_error_of_the_rate_is_no_effect_within_its_prior() -> None:
    healthy = recordings(measured_rate=True)
    scaled = [replace(one, injection_rate=1.01 * np.asarray(one.injection_rate)) for one in healthy]
    likelihood = joint_likelihood(measurements(scaled), MODEL)
    most = len(scaled) * (0.01 / GAIN_ERROR + 2.0) ** 2  # of each gain, two sigma of its own beside
    assert statistic_of(likelihood) < statistic_of(HEALTHY) + most


def test_a_wrong_shape_of_the_rate_counts_in_full() -> None:
    healthy = recordings(measured_rate=True)
    moved = [replace(one, injection_rate=np.roll(np.asarray(one.injection_rate), 5)) for one in healthy]
    likelihood = joint_likelihood(measurements(moved), MODEL)
    assert statistic_of(likelihood) > statistic_of(HEALTHY) + 10_000.0


def test_of_two_recordings_each_is_compared_with_the_shape_of_the_other() -> None:
    """By a shape that it had a part in, the one that is worn would look healthier."""
    pair = [recordings()[0], recordings((sized("orifice_area", v_H=0.05),))[0]]
    likelihood = joint_likelihood(measurements(pair), MODEL)
    remainder = healthy_remainder(likelihood, MODEL, ())
    assert (remainder.colour.opening or 0.0) > 3.5
    assert statistic_of(joint_likelihood(measurements(pair), MODEL, remainder.shape)) < statistic_of(likelihood) - 50


def test_a_skew_beyond_the_margin_has_no_solution() -> None:
    assert HEALTHY.residuals(effective_model(NOMINAL, (sized("channel_skew", d=300e-6),))) is None


def test_the_statistic_is_smooth_across_whole_samples_of_skew() -> None:
    likelihood = joint_likelihood(measurements(recordings((sized("channel_skew", d=10e-6),))), MODEL)
    values = [statistic_of(likelihood, sized("channel_skew", d=d)) for d in np.linspace(9.96e-6, 10.04e-6, 9)]
    assert np.abs(np.diff(values, 2)).max() < 1.0


def test_what_is_stated_of_the_channels_is_known() -> None:
    """Late and slow channels that the bench file states are explained by the model of the injector alone."""
    channels = (
        sized("rail_pressure_skew", d=8e-6),
        sized("channel_skew", d=-17e-6),
        sized("needle_lift_sensor_lag", tau=16e-6),
        sized("line_pressure_sensor_lag", tau=9e-6),
    )
    result = [replace(one, stated=channels) for one in measurements(recordings(channels))]
    by_effects = joint_likelihood([replace(one, stated=()) for one in result], effective_model(NOMINAL, channels))
    stated, alike = joint_likelihood(result, MODEL), effective_model(NOMINAL, channels)
    assert statistic_of(stated) == pytest.approx(statistic_of(by_effects, model=alike), rel=1e-12)
    assert statistic_of(stated) < statistic_of(by_effects) - 1e3
    judged = stated.judge(MODEL)
    assert judged is not None
    assert np.mean(np.concatenate([one.z for one in judged]) ** 2) == pytest.approx(1.0, abs=0.1)
    shown = [one.line_pressure for m in result for one in simulated(m, MODEL)]
    alone = [one.line_pressure for m in result for one in simulated(replace(m, stated=()), alike)]
    assert all(np.array_equal(a, b) for a, b in zip(shown, alone, strict=True))


_WAVES = NOMINAL.line.model_copy(update={"model": "wave", "damping": 1.0, "end_volume": 1e-8})
_ON_WAVES = with_cells(NOMINAL.model_copy(update={"line": _WAVES, "line_outflow": "seat"}))
MODELS = {"lump": MODEL, "wave": effective_model(_ON_WAVES)}


@cache
def _likelihood(rate: float, line: str) -> JointLikelihood:
    schedule = make_schedule([150e6], 1, 0.06, [0.8e-3])
    recording = simulate(NOMINAL, schedule, rate, (), SimulatedNoise()).recording
    return joint_likelihood(measurements([recording]), MODELS[line])


@given(
    rate=st.sampled_from(RATES),
    line=st.sampled_from(sorted(MODELS)),
    ids=st.lists(st.sampled_from(sorted(VOCABULARY)), min_size=1, max_size=2, unique=True),
    data=st.data(),
)
def test_a_candidate_is_judged_or_not_solved(rate: float, line: str, ids: list[str], data: st.DataObject) -> None:
    model = MODELS[line]
    for effect in (VOCABULARY[one] for one in ids):
        shares = [data.draw(st.sampled_from((0.0, 0.5, 1.0)) | st.floats(0.0, 1.0)) for _ in effect.parameters]
        values = [p.lowest + s * (p.highest - p.lowest) for p, s in zip(effect.parameters, shares, strict=True)]
        model = effect.apply(model, values)
    judged = _likelihood(rate, line).judge(model)
    if judged is not None:
        assert all(np.isfinite(one.z).all() and np.isfinite(one.log_sigma) for one in judged)


def test_faster_waves_are_solved_on_fewer_cells() -> None:
    faster = VOCABULARY["bulk_modulus"].apply(MODELS["wave"], [1.0])
    assert _likelihood(100e3, "wave").judge(faster) is not None
