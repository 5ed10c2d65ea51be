"""Latency by counts of quarters of octaves, against the latencies themselves."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.core.frames.frames import LATENCIES
from observer_rt.daemon.pump.memory import PUMP, latency_of


def counted(latencies: list[int]) -> Any:
    """As the loop counts latencies [ns]."""
    memory = np.zeros(1, PUMP)[0]
    for latency in latencies:
        octave = max(latency.bit_length() - 11, 0)
        quarter = (latency >> (octave + 8)) & 3 if latency >= 1024 else 0
        memory["latencies"][min(4 * octave + quarter, LATENCIES - 1)] += 1
    memory["largest_latency"] = max(latencies, default=0)
    return memory


@given(st.lists(st.integers(0, 300_000_000), min_size=1, max_size=3000))
def test_nearly_all_stay_within_it(latencies: list[int]) -> None:
    result = latency_of(counted(latencies))
    assert result is not None
    exact = 1e-9 * float(np.quantile(latencies, 0.999, method="inverted_cdf"))
    assert exact <= result.p999 * (1.0 + 1e-12)
    assert result.p999 <= max(1.25 * exact, 1.3e-6) or exact > 0.06
    assert result.largest == pytest.approx(1e-9 * max(latencies))


def test_none_before_the_first() -> None:
    assert latency_of(counted([])) is None
