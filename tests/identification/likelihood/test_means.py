"""Recordings whose samples are means, as `fit` and `discover` compare them with models."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from observer_rt.config.injector_sections import Meaning
from observer_rt.files.signals.recording import Recording
from observer_rt.identification.likelihood.likelihood import JudgedModel, joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.open_loop import mass, simulated
from observer_rt.identification.likelihood.true_inputs import TrueInputs
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import TRUE_INPUTS
from observer_rt.model.effects import effective_model, sized
from tests.engine.sample_stream import period_means
from tests.identification.discovery.hidden import MODEL, NOMINAL, recordings

pytestmark = pytest.mark.slow  # compiles what only these tests call, or is a whole closed loop

EVERY = 5  # samples of 100 kHz in a mean
C = MODEL.coefficients


def means(recording: Recording, meaning: Meaning | None) -> Recording:
    """Over the periods that end at every fifth sample."""
    averaged = {name: period_means(signal, EVERY) for name, signal in recording.signals.items()}
    time = recording.time[::EVERY][: averaged["rail_pressure"].size]
    return replace(recording.with_arrays({"time": time, **averaged}), meaning=meaning)


@cache
def measured(
    meaning: Meaning | None, hidden: tuple[SizedEffect, ...] = (), rate: bool = False
) -> tuple[Measurement, ...]:
    return measurements([means(one, meaning) for one in recordings(hidden, measured_rate=rate)])


def judged(meaning: Meaning | None) -> list[JudgedModel]:
    measured_recordings = joint_likelihood(measured(meaning, rate=True), MODEL).judge(MODEL)
    assert measured_recordings is not None
    return measured_recordings


def test_the_true_model_leaves_noise_alone_and_a_measured_rate_is_a_mean_too() -> None:
    right, wrong = (judged(meaning) for meaning in (Meaning.MEAN, None))
    z, other = (np.concatenate([one.z for one in found]) for found in (right, wrong))
    assert np.mean(z**2) == pytest.approx(1.0, abs=0.1)
    assert np.abs(z).max() < 5.0
    assert np.mean(other**2) - 1.0 > 2.0 * abs(np.mean(z**2) - 1.0)
    rate, other = (np.concatenate([one.rate_z for one in found]) for found in (right, wrong))
    assert np.mean(rate**2) < 1.6
    assert np.mean(other**2) > 3.0 * np.mean(rate**2)


def test_the_truth_explains_more_than_the_nominal_model() -> None:
    for hidden in (sized("orifice_area", v_H=0.05), sized("channel_skew", d=30e-6)):
        likelihood = joint_likelihood(measured(Meaning.MEAN, (hidden,)), MODEL)
        true, nominal = (likelihood.residuals(m) for m in (effective_model(NOMINAL, (hidden,)), MODEL))
        assert true is not None
        assert nominal is not None
        assert np.mean(true.z**2) == pytest.approx(1.0, abs=0.15)
        assert true.statistic < nominal.statistic - 100.0


def test_the_area_is_that_of_the_needle() -> None:
    """Straight from knot to knot it comes to what 100 kHz show, with its feet where they were."""
    (fine, *_), (slow, *_) = measurements(recordings()), measured(Meaning.MEAN)
    expected = TrueInputs(fine, TRUE_INPUTS, C).area
    inputs = TrueInputs(slow, TRUE_INPUTS, C)
    knots = np.arange(inputs.area.size) + inputs.knots[:, 0]
    position = np.asarray(np.sort(np.append(np.arange(inputs.area.size), knots)), np.float64)
    area = np.column_stack([inputs.area, inputs.knots[:, 1]]).ravel().astype(np.float64)
    result = np.interp(np.arange(expected.size) / EVERY, position, area)
    assert np.abs(np.maximum(result, 0.0) - np.maximum(expected, 0.0)).max() < 0.06
    total = np.maximum(expected, 0.0).sum()
    assert np.maximum(result, 0.0).sum() == pytest.approx(total, rel=2e-3)


def test_a_mass_is_that_at_100_khz() -> None:
    for fine, slow in zip(measurements(recordings()), measured(Meaning.MEAN), strict=True):
        density = C.density
        for first, second in zip(simulated(fine, MODEL), simulated(slow, MODEL), strict=True):
            assert mass(slow, second, density) == pytest.approx(mass(fine, first, density), rel=5e-3)
