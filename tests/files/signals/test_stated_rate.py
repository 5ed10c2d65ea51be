"""A stated sample rate replaces missing stamps; where none is stated, stamps tell theirs."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.files.replay.framing import bench_for
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.time_axis import rate_of
from observer_rt.foundation.errors import UserError
from tests.baselines import baseline
from tests.files.signals.foreign import COLUMNS, RATE, bench, opened, write_rows

SAMPLES = 2 * SAMPLES_AT_ONCE + 500
WITHOUT_TIME = COLUMNS.replace('[recording.time]\ncolumn = "t"\n{time}\n', "")


def test_good_stamps_are_kept_whatever_is_stated(tmp_path: Path) -> None:
    kept = np.delete(np.arange(SAMPLES), range(8000, 8100))
    stream = opened(write_rows(tmp_path, kept / RATE, 2), tmp_path, "rate_hz = 100e3")
    assert [stretch.samples for stretch in stream.stretches] == [8000, SAMPLES - 8100]


@pytest.mark.parametrize("rate", [50e3, 100e3])
def test_without_a_time_rows_follow_at_the_rate(tmp_path: Path, rate: float) -> None:
    """The stated rate is also that of the grid."""
    stream = opened(write_rows(tmp_path, np.arange(SAMPLES) / RATE, 2), tmp_path, f"rate_hz = {rate}", WITHOUT_TIME)
    assert stream.sample_rate == rate
    recording = stream.collected()
    assert recording.samples == SAMPLES
    np.testing.assert_allclose(recording.time, np.arange(SAMPLES) / rate, atol=1e-9)
    np.testing.assert_array_equal(recording.needle_lift, np.arange(SAMPLES) % 100 * 1e-6)
    assert any("no column of the time" in note for note in stream.notes)


def test_without_time_and_rate_the_line_to_write_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"\[recording\] rate_hz = 100e3"):
        opened(write_rows(tmp_path, np.arange(SAMPLES) / RATE, 2), tmp_path, "", WITHOUT_TIME)


@pytest.mark.parametrize(
    ("rate", "is_refused"), [(98_039.2, True), (102e3, True), (96e3, False), (100.1e3, False), (50e3, False)]
)
def test_a_clock_a_little_off_is_refused_unless_it_is_stated(tmp_path: Path, rate: float, is_refused: bool) -> None:
    """Of the grid or the model; a recorder set to another rate is further off, or at one that recorders have."""
    path = write_rows(tmp_path, np.arange(SAMPLES) / rate)
    stated = opened(path, tmp_path, f"rate_hz = {rate}")
    assert bench_for(bench(tmp_path, f"rate_hz = {rate}"), stated).injector.sample_rate == rate
    fitted = load_injector().model_copy(update={"baseline": baseline()})
    for read in (partial(opened, path, tmp_path), partial(bench_for, load_bench().with_parameters(fitted), stated)):
        with pytest.raises(UserError, match="a clock is off by 2") if is_refused else nullcontext() as refused:
            read()
        assert refused is None or f"rate_hz = {rate:.9g}" in refused.value.remedy


@pytest.mark.parametrize(("rate", "digits"), [(100e3, 5), (48e3, 6), (30e3, 7), (1e6 / 3.0, 7), (12_345.0, 9)])
def test_the_rate_of_stamps_is_a_round_one(rate: float, digits: int) -> None:
    result = rate_of(np.round(np.arange(20_000) / rate, digits))
    assert result == pytest.approx(rate, rel=1e-9)
