"""The optional input `energizing`: which command an opening belongs to, and how long after it the needle opens."""

from pathlib import Path

import pytest

from observer_rt.config import load_injector
from tests.service.core_frames import SAMPLE_RATE
from tests.service.pulse_frames import (
    CYCLIC,
    LEVEL,
    LEVELS_IN_BLOCK,
    SAFE,
    TIME,
    TIME_BY_STAMP,
    blocks,
    commands,
    cyclic,
    durations,
    injected,
    on_change,
    pulse_bench,
    safe_durations,
    samples,
    watch,
)

DELAY = load_injector().needle.opening_delay
SAMPLE = 1 / SAMPLE_RATE
SOURCES = {
    "level": (LEVEL, on_change, SAMPLE, SAMPLE),
    "duration": (TIME, durations, SAMPLE, 1e-7),
    "block": (LEVELS_IN_BLOCK, lambda pulses: blocks(pulses, 0.0, 0.3), SAMPLE, SAMPLE),
    "by stamp": (TIME_BY_STAMP, durations, SAMPLE, 1e-7),
    "protected": (SAFE, safe_durations, SAMPLE, 1e-7),
    "cyclic": (CYCLIC, lambda pulses: cyclic(pulses, 0.3), 0.5e-3 + SAMPLE, 1e-3),
}


@pytest.mark.parametrize("name", SOURCES)
def test_every_opening_has_its_command(tmp_path: Path, name: str) -> None:
    lines, source, delay_error, time_error = SOURCES[name]
    schedule, recording = injected(3)
    watched = watch(pulse_bench(tmp_path, lines), samples(recording), source(commands(schedule)))
    assert watched.commands == [1, 2, 3]
    assert watched.mismatches == []
    for report in watched.reports:
        assert report.commanded is not None
        assert report.commanded.opening_delay == pytest.approx(DELAY, abs=1.5 * delay_error)
        assert report.commanded.energizing_time == pytest.approx(1.1e-3, abs=1.01 * time_error)
