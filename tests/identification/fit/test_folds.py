"""Recordings as a fit sees them, without the line-pressure sensor's gain; refusals, and reasons to be unsure."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.config.injector_sections import Meaning
from observer_rt.desk.library.fit import fitted_model
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from observer_rt.identification.fit import suitability
from observer_rt.identification.fit.calibrate import calibrate
from observer_rt.identification.fit.document import oddities
from observer_rt.identification.fit.fitted_file import baseline_of, write_fitted
from observer_rt.identification.fit.masses import MEAN, WeighedMass
from observer_rt.identification.fit.problem import folds_of, thinned
from observer_rt.identification.likelihood.measurement import Measurement, measurements, without_gain
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from tests.identification.fit.healthy import LUMPS, NOMINAL, POINTS, simulations

TWO = measurements([one.recording for one in simulations([(60e6, 0.6e-3), (100e6, 1.9e-3)], injections=5)])
TURNS = make_schedule([60e6, 100e6], 4, 0.06, [0.6e-3])
MIXED = measurements([simulate(NOMINAL, TURNS, 100e3, (), SimulatedNoise()).recording])
SENSORS = StatedAccuracy(0.007, 0.007)
GAIN = 0.012
THREE_PRESSURES = [(60e6, 1.2e-3), (100e6, 0.8e-3), (140e6, 1.2e-3)]


def test_a_recording_of_two_operating_points_falls_into_them() -> None:
    folds = folds_of(MIXED, {})
    assert [len(fold.measurement.events) for fold in folds] == [2, 2]
    assert {fold.recording for fold in folds} == {0}


def test_a_thinned_part_stands_for_all_its_injections() -> None:
    fold = thinned(folds_of(TWO, {})[1], 2)
    assert (len(fold.measurement.events), fold.weights.tolist()) == (2, [2.5, 2.5])


def test_a_mean_mass_is_compared_in_standard_deviations() -> None:
    fold = folds_of(TWO, {0: {MEAN: WeighedMass(3.0, 0.5)}})[0]
    for part, factor in ((fold, 1.0), (replace(fold, tempering=9.0), 3.0)):  # pressures leave nine times their noise
        assert part.mass_residuals(np.arange(1.06, 6.0)) == pytest.approx([factor * (3.06 - 3.0) / 0.5])
    assert folds_of(TWO, {})[0].mass_residuals(np.ones(5)).size == 0


def test_a_weighed_injection_is_kept_and_compared_with_its_own_mass() -> None:
    weighed = {number: WeighedMass(float(number), 0.5) for number in (2, 4)}
    (fold, _) = folds_of(TWO, {0: weighed})
    assert fold.mass_residuals(np.arange(1.0, 6.0) + 0.1) == pytest.approx([0.2, 0.2])
    few = thinned(fold, 3)
    assert {2, 4} < {event.number for event in few.measurement.events}
    assert few.mass_residuals(np.array([n.number for n in few.measurement.events]) - 1.0) == pytest.approx(
        [-2.0, -2.0]
    )
    assert thinned(fold, 1).mass_residuals(np.ones(1)).size == 1


def test_an_injection_cut_off_counts_and_has_no_mass() -> None:
    recording = TWO[0].recording
    late = int(TWO[0].events[0].openings[0].first) - 50
    names = ("time", "rail_pressure", "needle_lift", "line_pressure")
    (cut,) = measurements([replace(recording, **{name: getattr(recording, name)[late:] for name in names})])
    assert [event.number for event in cut.events] == [2, 3, 4, 5]
    weighed = {number: WeighedMass(1.0, 0.5) for number in (1, 2)}
    assert folds_of([cut], {0: weighed})[0].mass_residuals(np.ones(4)) == pytest.approx([0.0])


def test_one_recording_with_a_mass_is_not_taken_apart() -> None:
    """Its mass is that of all its operating points."""
    (fold,) = folds_of(MIXED, {0: {MEAN: WeighedMass(3.0, 0.5)}})
    assert len(fold.measurement.events) == 4


def test_an_offset_is_found_at_standstill() -> None:
    recording = TWO[0].recording
    (moved,) = measurements([replace(recording, line_pressure=recording.line_pressure + 0.8e6)])
    (before, pressure), (after, _) = (suitability.standstill(one) for one in (TWO[0], moved))
    assert pressure == pytest.approx(60e6, abs=0.3e6)
    assert after - before == pytest.approx(0.8e6, abs=1.0)


RECORDING = simulations([(100e6, 1.9e-3)])[0].recording
Change = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def changed(signal: str, change: Change) -> Recording:
    changes: dict[str, Any] = {signal: change(getattr(RECORDING, signal))}
    return replace(RECORDING, **changes)


@pytest.mark.parametrize(
    ("signal", "change", "level"),
    [
        ("line_pressure", lambda values: np.minimum(values, 102e6), "102 MPa"),
        ("line_pressure", lambda values: np.maximum(values, 94e6), "94 MPa"),
        ("needle_lift", lambda values: np.minimum(values, 0.25e-3), "250 um"),
    ],
)
def test_a_clipped_signal_is_refused(signal: str, change: Change, level: str) -> None:
    with pytest.raises(UserError, match=f"{signal}: is clipped: .* exactly {level}"):
        suitability.refuse_clipped(measurements([changed(signal, change)]))


@pytest.mark.parametrize(
    ("signal", "change"),
    [
        ("line_pressure", lambda values: np.round(values / 1e6) * 1e6),  # coarse
        ("needle_lift", lambda values: np.maximum(values, 0.0)),
    ],
)
def test_a_coarse_signal_and_a_zero_at_rest_are_not_clipped(signal: str, change: Change) -> None:
    suitability.refuse_clipped(measurements([changed(signal, change)]))


def test_one_operating_point_is_warned_of() -> None:
    words = suitability.warnings(measurements([RECORDING]))
    assert any("one rail pressure and one energizing time only" in one for one in words)
    assert any("3 injections only" in one for one in words)


def _every_fifth(meaning: Meaning) -> Recording:
    names = ("time", "rail_pressure", "needle_lift", "line_pressure")
    return replace(RECORDING, meaning=meaning, **{name: getattr(RECORDING, name)[::5] for name in names})


def test_slow_instants_are_warned_of_and_make_masses_less_sure() -> None:
    (slow,) = measurements([_every_fifth(Meaning.INSTANT)])
    assert suitability.share_between_samples(slow) == pytest.approx(0.005)
    (warning,) = (one for one in suitability.warnings([slow]) if "instants" in one)
    assert "20000 Hz" in warning
    assert 'meaning = "mean"' in warning


@pytest.mark.parametrize("recording", [RECORDING, _every_fifth(Meaning.MEAN)], ids=["100 kHz", "means"])
def test_fast_instants_and_means_are_not_warned_of(recording: Recording) -> None:
    (measurement,) = measurements([recording])
    assert suitability.share_between_samples(measurement) == pytest.approx(0.0, abs=1e-6)
    assert not any("instants" in words for words in suitability.warnings([measurement]))


def test_one_pressure_and_one_duration_are_warned_of() -> None:
    by_time = [one.recording for one in simulations([(100e6, 0.6e-3), (100e6, 1.9e-3)])]
    assert any("one rail pressure only" in one for one in suitability.warnings(measurements(by_time)))
    by_pressure = [one.recording for one in simulations([(60e6, 1.9e-3), (61e6, 1.9e-3), (140e6, 1.9e-3)])]
    assert any("one energizing time only" in one for one in suitability.warnings(measurements(by_pressure)))


def test_six_points_need_no_warning() -> None:
    assert suitability.warnings(measurements([one.recording for one in simulations(POINTS)])) == []


def measured_with(gain: float, offset: float = 0.3e6, injections: int = 3) -> list[Measurement]:
    made = [one.recording for one in simulations(THREE_PRESSURES, injections=injections, seed=4)]
    return list(measurements([replace(one, line_pressure=(1.0 + gain) * one.line_pressure + offset) for one in made]))


def test_several_pressures_tell_it_from_an_offset() -> None:
    """Before the line has rung."""
    assert suitability.sensor_gain(measured_with(GAIN, injections=1), SENSORS) == pytest.approx(GAIN, abs=3e-4)
    assert suitability.sensor_gain(measured_with(GAIN), EXACT) == 0.0


def test_one_pressure_leaves_it_within_the_accuracy() -> None:
    assert abs(suitability.sensor_gain(measured_with(GAIN)[:1], SENSORS)) < 0.2 * GAIN


def test_recordings_and_masses_become_those_of_the_rail_sensor() -> None:
    level = SENSORS.level(GAIN)
    (first, *_), (other, *_) = without_gain(measured_with(GAIN, 0.0), GAIN, level), measured_with(0.0, 0.0)
    assert first.recording.line_pressure == pytest.approx(other.recording.line_pressure)
    assert WeighedMass(41e-6, 1e-7).by(level) == pytest.approx((41e-6 / 1.006, 1e-7 / 1.006))


def test_a_fit_by_such_a_sensor_finds_the_injector(tmp_path: Path) -> None:
    done: list[float] = []
    fitted = fitted_model(NOMINAL, measured_with(GAIN), {}, {}, done.append, SENSORS)
    assert 0.5 < max(done) < 1.0  # the observer runs along the recordings afterwards
    assert fitted.done.inadequate == ()
    assert fitted.baseline.line_pressure_sensor_gain == pytest.approx(GAIN, abs=1.8e-3)  # two sigma
    assert fitted.done.injector.line.loss_factor == pytest.approx(NOMINAL.line.loss_factor, rel=0.05)
    write_fitted(tmp_path / "fitted.toml", InjectorFile.read(NOMINAL_INJECTOR), fitted.done, fitted.baseline)
    assert load_injector(tmp_path / "fitted.toml").accuracy == NOMINAL.accuracy  # nothing was measured


def test_a_measured_mass_leaves_its_own_accuracy(tmp_path: Path) -> None:
    seen = measured_with(0.0, 0.0)
    mass = WeighedMass(40e-6, 0.003 * 40e-6)
    done = calibrate(NOMINAL, seen, {0: {MEAN: mass}}, lambda _: None, LUMPS[:1])
    write_fitted(tmp_path / "fitted.toml", InjectorFile.read(NOMINAL_INJECTOR), done, baseline_of(done, {}))
    accuracy = load_injector(tmp_path / "fitted.toml").accuracy
    assert accuracy.mass_percent is not None
    assert 0.3 <= accuracy.mass_percent < 0.6
    assert done.mass_share < 0.002  # the level's is not in both
    off = {
        n: {MEAN: WeighedMass((1.045 if n == 1 else 1.0) * made.mass_mg["fitted"], 1e-8)}
        for n, made in enumerate(done.comparison.masses(1e-6))
        if made.mass_mg["fitted"]
    }
    done = calibrate(done.injector, seen, off, lambda _: None, LUMPS[:1])
    assert 0.0199 < done.mass_share < 0.03  # at the middle pressure alone, which no model meets
    assert "measured masses are" in oddities(done)[-1]
    assert StatedAccuracy.of(0.7, 0.7, accuracy).is_calibrated
