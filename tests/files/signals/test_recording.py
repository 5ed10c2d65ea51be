"""What a recording refuses, whatever file it came from."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError

Values = NDArray[np.float64]
TIME = np.arange(100) / 20e3
SIGNAL = np.ones(100)


INFINITE = np.where(np.arange(100) == 5, np.inf, 1.0)


@pytest.mark.parametrize(
    ("time", "lift", "line", "said"),
    [
        (TIME, SIGNAL[1:], SIGNAL, "x.mf4, needle_lift: 99 samples, but the time has 100"),
        (TIME, SIGNAL, INFINITE, "x.mf4, sample 5: line_pressure is infinite"),
        (TIME + (np.arange(100) >= 50), SIGNAL, SIGNAL, "x.mf4, sample 50: gap in time"),
    ],
)
def test_what_is_refused(time: Values, lift: Values, line: Values, said: str) -> None:
    with pytest.raises(UserError, match=said):
        Recording(time, SIGNAL, lift, line, path=Path("x.mf4"))
