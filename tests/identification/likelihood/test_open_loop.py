"""A model run open loop through a recording."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.engine.estimation.predictor import NoiseLevels as Levels
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.identification.discovery.injections import rms
from observer_rt.identification.likelihood.measurement import measurements, noisier
from observer_rt.identification.likelihood.open_loop import mass, measured_mass, pressure_gap, simulated
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.hidden import NOMINAL, recordings

NOISE = Levels(rail_pressure=0.1e6, line_pressure=0.15e6, needle_lift=0.4e-6)


def _missed(model: EffectiveModel, *hidden: SizedEffect) -> list[float]:
    """Rms of the line pressure of every run [Pa], on noise-free recordings weighed as if they had the usual noise."""
    measured = [replace(one, noise=NOISE) for one in measurements(recordings(hidden, noise=None))]
    return [rms(pressure_gap(one, run)) for one in measured for run in simulated(one, model)]


@pytest.mark.parametrize(
    "hidden",
    [
        (),
        (sized("orifice_area", v_H=0.2),),
        (sized("line_pressure_sensor_lag", tau=40e-6),),
        (sized("channel_skew", d=33e-6),),
        (sized("channel_skew", d=-12e-6),),
        (sized("line_pressure_sensor_offset", o=0.8e6),),
        (sized("rail_pressure_sensor_gain", g=0.01),),
    ],
)
def test_the_true_model_runs_along_the_measurement(hidden: tuple[SizedEffect, ...]) -> None:
    assert max(_missed(effective_model(NOMINAL, hidden), *hidden)) < 0.05e6


def test_the_nominal_model_misses_what_is_hidden() -> None:
    assert min(_missed(effective_model(NOMINAL), sized("orifice_area", v_H=0.2))) > 0.3e6


@pytest.mark.parametrize("meter", [(), (0.3e-3,)])
def test_mass_of_the_true_model_is_the_measured_mass(meter: tuple[float, ...]) -> None:
    hidden = sized("orifice_area", v_H=0.2)
    model = effective_model(NOMINAL, (hidden,))
    density = model.coefficients.density
    for made in recordings((hidden,), measured_rate=True):
        shown = shown_slowly(made.signals["injection_rate"], float(made.time[1]), *meter)
        (measurement,) = measurements([replace(made, injection_rate=shown, meter=meter)])
        for run in simulated(measurement, model):
            ours, measured = mass(measurement, run, density), measured_mass(measurement, run, density)
            assert ours == pytest.approx(measured, rel=0.02)
            assert 10e-6 < ours < 200e-6


def test_noise_is_added_once_more() -> None:
    (measurement, *_) = measurements(recordings())
    more = noisier(measurement, seed=5)
    added = more.recording.line_pressure - measurement.recording.line_pressure
    assert np.std(added) == pytest.approx(measurement.noise.line_pressure, rel=0.05)
    assert np.array_equal(noisier(measurement, seed=5).recording.needle_lift, more.recording.needle_lift)
