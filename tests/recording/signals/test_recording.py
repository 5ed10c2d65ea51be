"""What a recording refuses, whatever file it came from."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.recording import Recording

TIME = np.arange(100) / 20e3
SIGNAL = np.ones(100)


def test_samples_and_rate() -> None:
    recording = Recording(TIME, SIGNAL, SIGNAL, SIGNAL)
    assert recording.samples == 100
    assert recording.sample_rate == 20e3
    assert list(recording.signals) == ["rail_pressure", "needle_lift", "line_pressure"]


def test_nan_is_accepted_as_not_available() -> None:
    missing = SIGNAL.copy()
    missing[3] = np.nan
    assert np.isnan(Recording(TIME, missing, missing, missing, missing).rail_pressure[3])


def test_signals_of_another_length_are_refused() -> None:
    with pytest.raises(UserError, match=r"needle_lift: 99 samples, but the time has 100"):
        Recording(TIME, SIGNAL, SIGNAL[1:], SIGNAL)


def test_infinite_values_are_refused() -> None:
    infinite = SIGNAL.copy()
    infinite[5] = np.inf
    with pytest.raises(UserError, match=r"x\.mf4, sample 5: line_pressure is infinite"):
        Recording(TIME, SIGNAL, SIGNAL, infinite, path=Path("x.mf4"))


def test_uneven_time_is_refused_with_its_sample() -> None:
    time = TIME.copy()
    time[50:] += 1.0
    with pytest.raises(UserError, match="recording, sample 50: gap in time"):
        Recording(time, SIGNAL, SIGNAL, SIGNAL)
