"""What an inadequate fit says first is the most probable cause."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.evidence.measurement import measurements
from observer_rt.fit.calibrate import calibrate
from observer_rt.fit.problem import STRUCTURES
from observer_rt.fit.report import verdict_words
from observer_rt.recording.signals.recording import Recording
from tests.fit.healthy import NOMINAL, simulations


def _late_lift(recording: Recording) -> Recording:
    return replace(recording, needle_lift=np.roll(recording.needle_lift, 20))


def _inverted(recording: Recording) -> Recording:
    return replace(recording, line_pressure=2.0 * recording.line_pressure[0] - recording.line_pressure)


def _interpolated(recording: Recording) -> Recording:
    places = np.arange(recording.samples)
    return replace(recording, line_pressure=np.interp(places, places[::5], recording.line_pressure[::5]))


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (_late_lift, "signals do not belong together"),
        (_inverted, "signals do not belong together"),
        (_interpolated, "not smoothed, interpolated"),
    ],
)
def test_what_is_wrong_with_the_signals_is_said(spoilt: object, words: str) -> None:
    assert callable(spoilt)
    found = measurements([spoilt(one.recording) for one in simulations(((60e6, 0.6e-3), (100e6, 1.9e-3)))])
    done = calibrate(NOMINAL, found, {}, lambda _: None, STRUCTURES[:1])
    assert words in verdict_words(done)
