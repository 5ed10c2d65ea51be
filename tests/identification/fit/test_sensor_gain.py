"""One gain of the line-pressure sensor over the rail's for all recordings, taken out before a fit."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.fitted_model import fitted_model
from observer_rt.identification.fit.calibrate import baseline_of, calibrate, write_fitted
from observer_rt.identification.fit.cross_validation import sensor_gain, without_gain
from observer_rt.identification.fit.masses import MeasuredMasses, masses_without
from observer_rt.identification.fit.problem import STRUCTURES
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from tests.identification.fit.healthy import NOMINAL, simulations

SENSORS = StatedAccuracy(0.007, 0.007)
GAIN = 0.012
POINTS = [(60e6, 1.2e-3), (100e6, 0.8e-3), (140e6, 1.2e-3)]
LUMP = [one for one in STRUCTURES if one.line == "lump"][:1]


def measured_with(gain: float, offset: float = 0.3e6, injections: int = 3) -> list[Measurement]:
    recordings = [one.recording for one in simulations(POINTS, injections=injections, seed=4)]
    changed = [replace(one, line_pressure=(1.0 + gain) * one.line_pressure + offset) for one in recordings]
    return list(measurements(changed))


def test_several_pressures_tell_it_from_an_offset() -> None:
    """Before the line has rung."""
    assert sensor_gain(measured_with(GAIN, injections=1), SENSORS) == pytest.approx(GAIN, abs=3e-4)
    assert sensor_gain(measured_with(GAIN), EXACT) == 0.0


def test_one_pressure_leaves_it_within_the_accuracy() -> None:
    assert abs(sensor_gain(measured_with(GAIN)[:1], SENSORS)) < 0.2 * GAIN


def test_recordings_and_masses_become_those_of_the_rail_sensor() -> None:
    level = SENSORS.level(GAIN)
    (first, *_), (other, *_) = without_gain(measured_with(GAIN, 0.0), GAIN, level), measured_with(0.0, 0.0)
    assert first.recording.line_pressure == pytest.approx(other.recording.line_pressure)
    weighed = {0: MeasuredMasses({5: (40e-6, 2e-7)}, (41e-6, 1e-7))}
    changed = masses_without(weighed, level)[0]
    assert changed.single[5] == pytest.approx((40e-6 / 1.006, 2e-7 / 1.006))
    assert changed.mean == pytest.approx((41e-6 / 1.006, 1e-7 / 1.006))


def test_a_fit_by_such_a_sensor_finds_the_injector(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer_rt.desk.fitted_model.calibrate", partial(calibrate, structures=LUMP))
    fitted = fitted_model(NOMINAL, measured_with(GAIN), {}, {}, lambda _: None, SENSORS)
    assert fitted.done.inadequate == ()
    assert fitted.baseline.line_pressure_sensor_gain == pytest.approx(GAIN, abs=1.8e-3)  # two sigma
    assert fitted.done.injector.line.loss_factor == pytest.approx(NOMINAL.line.loss_factor, rel=0.05)
    fitted.write(tmp_path / "fitted.toml", InjectorFile.read(NOMINAL_INJECTOR))
    assert load_injector(tmp_path / "fitted.toml").accuracy == NOMINAL.accuracy  # nothing was measured


def test_a_measured_mass_leaves_its_own_accuracy(tmp_path: Path) -> None:
    seen = measured_with(0.0, 0.0)
    first = seen[0].events[0].openings[0].first
    mass = MeasuredMasses({first: (40e-6, 0.003 * 40e-6)})
    done = calibrate(NOMINAL, seen, {0: mass}, lambda _: None, LUMP)
    write_fitted(tmp_path / "fitted.toml", InjectorFile.read(NOMINAL_INJECTOR), done, baseline_of(done, {}))
    accuracy = load_injector(tmp_path / "fitted.toml").accuracy
    assert accuracy.mass_percent is not None
    assert 0.3 <= accuracy.mass_percent < 0.6
    assert done.mass_share < 0.002  # the level's is not in both
    assert StatedAccuracy.of(0.7, 0.7, accuracy).is_calibrated
