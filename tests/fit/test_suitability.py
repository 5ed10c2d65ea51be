"""Recordings that cannot serve are refused; what makes a result unsure is said."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.config.recording import Meaning
from observer_rt.evidence.measurement import measurements
from observer_rt.fit.parts import refuse_clipped, share_between_samples, warnings
from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.recording import Recording
from tests.fit.healthy import POINTS, simulations

RECORDING = simulations([(100e6, 1.9e-3)])[0].recording


def _refused(recording: Recording) -> str:
    with pytest.raises(UserError) as error:
        refuse_clipped(measurements([recording]))
    return f"{error.value}"


def test_healthy_recordings_are_taken() -> None:
    refuse_clipped(measurements([one.recording for one in simulations()]))


@pytest.mark.parametrize("highest", [102e6, 106e6])
def test_a_clipped_line_pressure_is_refused(highest: float) -> None:
    text = _refused(replace(RECORDING, line_pressure=np.minimum(RECORDING.line_pressure, highest)))
    assert "line_pressure" in text
    assert f"exactly {highest / 1e6:g} MPa" in text


def test_a_pressure_clipped_from_below_is_refused() -> None:
    text = _refused(replace(RECORDING, line_pressure=np.maximum(RECORDING.line_pressure, 94e6)))
    assert "94 MPa" in text


def test_a_clipped_lift_is_refused() -> None:
    text = _refused(replace(RECORDING, needle_lift=np.minimum(RECORDING.needle_lift, 0.25e-3)))
    assert "needle_lift" in text
    assert "250 um" in text


def test_a_lift_that_is_never_negative_serves() -> None:
    refuse_clipped(measurements([replace(RECORDING, needle_lift=np.maximum(RECORDING.needle_lift, 0.0))]))


def test_a_coarse_signal_is_not_taken_for_a_clipped_one() -> None:
    coarse = np.round(RECORDING.line_pressure / 1e6) * 1e6
    refuse_clipped(measurements([replace(RECORDING, line_pressure=coarse)]))


def test_one_operating_point_is_warned_of() -> None:
    words = warnings(measurements([RECORDING]))
    assert any("one operating point only" in one for one in words)
    assert any("3 injections only" in one for one in words)


def _every_fifth(meaning: Meaning) -> Recording:
    every = slice(None, None, 5)
    return Recording(
        RECORDING.time[every],
        RECORDING.rail_pressure[every],
        RECORDING.needle_lift[every],
        RECORDING.line_pressure[every],
        meaning=meaning,
    )


def test_slow_instants_are_warned_of_and_make_masses_less_sure() -> None:
    (slow,) = measurements([_every_fifth(Meaning.INSTANT)])
    assert share_between_samples(slow) == pytest.approx(0.005)
    (warning,) = (one for one in warnings([slow]) if "instants" in one)
    assert "20000 Hz" in warning
    assert 'meaning = "mean"' in warning


@pytest.mark.parametrize("recording", [RECORDING, _every_fifth(Meaning.MEAN)], ids=["100 kHz", "means"])
def test_fast_instants_and_means_are_not(recording: Recording) -> None:
    (one,) = measurements([recording])
    assert share_between_samples(one) == pytest.approx(0.0, abs=1e-6)
    assert not any("instants" in words for words in warnings([one]))


def test_one_pressure_and_one_duration_are_warned_of() -> None:
    by_time = [one.recording for one in simulations([(100e6, 0.6e-3), (100e6, 1.9e-3)])]
    assert any("one rail pressure only" in one for one in warnings(measurements(by_time)))
    by_pressure = [one.recording for one in simulations([(60e6, 1.9e-3), (61e6, 1.9e-3), (140e6, 1.9e-3)])]
    assert any("one energizing time only" in one for one in warnings(measurements(by_pressure)))


def test_six_points_need_no_warning() -> None:
    assert warnings(measurements([one.recording for one in simulations(POINTS)])) == []
