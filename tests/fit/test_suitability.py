"""Recordings that cannot serve are refused; what makes a result unsure is said."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.evidence.measurement import measurements
from observer_rt.fit.suitability import refuse_clipped, warnings
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


def test_one_pressure_and_one_duration_are_warned_of() -> None:
    by_time = [one.recording for one in simulations([(100e6, 0.6e-3), (100e6, 1.9e-3)])]
    assert any("one rail pressure only" in one for one in warnings(measurements(by_time)))
    by_pressure = [one.recording for one in simulations([(60e6, 1.9e-3), (61e6, 1.9e-3), (140e6, 1.9e-3)])]
    assert any("one energizing time only" in one for one in warnings(measurements(by_pressure)))


def test_six_points_need_no_warning() -> None:
    assert warnings(measurements([one.recording for one in simulations(POINTS)])) == []
