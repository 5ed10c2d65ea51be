"""A stated sample rate replaces rounded or missing stamps, unless the stamps contradict it."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.time_axis import StampPace, rate_of
from observer_rt.foundation.errors import UserError
from tests.files.signals.foreign import COLUMNS, RATE, opened, write_rows

SAMPLES = 2 * SAMPLES_AT_ONCE + 500
WITHOUT_TIME = COLUMNS.replace('[recording.time]\ncolumn = "t"\n{time}\n', "")


@pytest.mark.parametrize(("rounding", "options"), [(1e-3, ""), (1.0, "rate_hz = 100e3")])
def test_rounded_stamps_are_placed_by_the_rate(tmp_path: Path, rounding: float, options: str) -> None:
    """By the rate of the grid, or of `[recording]`: stamps in whole seconds repeat over 100,000 rows."""
    if rounding == 1.0:
        time = np.floor((np.arange(150_000) + 60_000) / RATE)
        path = write_rows(tmp_path, time, 2)
    else:
        path = write_rows(tmp_path, np.floor(np.arange(SAMPLES) / RATE / rounding) * rounding, 2)
    stream = opened(path, tmp_path, options)
    recording = stream.collected()
    assert len(stream.stretches) == 1
    np.testing.assert_allclose(np.diff(recording.time), 1.0 / RATE, rtol=1e-6)
    np.testing.assert_array_equal(recording.needle_lift, np.arange(recording.samples) % 100 * 1e-6)
    assert any("rows are placed by the rate stated, 100000 Hz" in note for note in stream.notes)


def test_a_gap_beyond_the_rounding_still_splits(tmp_path: Path) -> None:
    kept = np.delete(np.arange(SAMPLES + 3000), range(8000, 11000))
    stream = opened(write_rows(tmp_path, np.floor(kept / RATE / 1e-3) * 1e-3, 2), tmp_path)
    assert [stretch.samples for stretch in stream.stretches] == [8000, SAMPLES - 8000]
    assert stream.stretches[1].start == pytest.approx(11000 / RATE, abs=1e-3)


@pytest.mark.parametrize("options", ["", "rate_hz = 100e3"])
def test_a_rate_that_the_stamps_contradict_is_not_trusted(tmp_path: Path, options: str) -> None:
    slower = np.floor(np.arange(SAMPLES) / 80e3 / 1e-3) * 1e-3
    with pytest.raises(UserError, match="are not those of 100000 Hz") as raised:
        opened(write_rows(tmp_path, slower, 2), tmp_path, options)
    assert "[recording] rate_hz" in raised.value.remedy


def test_good_stamps_are_kept_whatever_is_stated(tmp_path: Path) -> None:
    kept = np.delete(np.arange(SAMPLES), range(8000, 8100))
    stream = opened(write_rows(tmp_path, kept / RATE, 2), tmp_path, "rate_hz = 100e3")
    assert [stretch.samples for stretch in stream.stretches] == [8000, SAMPLES - 8100]


@pytest.mark.parametrize("rate", [50e3, 100e3])
def test_without_a_time_rows_follow_at_the_rate(tmp_path: Path, rate: float) -> None:
    """The stated rate is also that of the grid."""
    path = write_rows(tmp_path, np.arange(SAMPLES) / RATE, 2)
    stream = opened(path, tmp_path, f"rate_hz = {rate}", WITHOUT_TIME)
    assert stream.sample_rate == rate
    recording = stream.collected()
    assert recording.samples == SAMPLES
    np.testing.assert_allclose(recording.time, np.arange(SAMPLES) / rate, atol=1e-9)
    np.testing.assert_array_equal(recording.needle_lift, np.arange(SAMPLES) % 100 * 1e-6)
    assert any("no column of the time" in note for note in stream.notes)


def test_without_time_and_rate_the_line_to_write_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"\[recording\] rate_hz = 100e3"):
        opened(write_rows(tmp_path, np.arange(SAMPLES) / RATE, 2), tmp_path, "", WITHOUT_TIME)


def test_a_pace_is_the_same_however_it_is_cut() -> None:
    stamps = np.floor(np.delete(np.arange(5000), range(2000, 2400)) / RATE / 1e-3) * 1e-3
    complete = StampPace(RATE, 1e-3).take(stamps)
    cut = StampPace(RATE, 1e-3)
    parts = [cut.take(part) for part in np.split(stamps, [1, 2, 700, 2000, 2001])]
    np.testing.assert_array_equal(np.concatenate(parts), complete)
    assert cut.agrees


@pytest.mark.parametrize(
    ("rate", "digits"), [(100e3, 5), (48e3, 6), (30e3, 7), (50e3, 3), (1e6 / 3.0, 7), (12_345.0, 9)]
)
def test_the_rate_of_stamps_is_a_round_one(rate: float, digits: int) -> None:
    result = rate_of(np.round(np.arange(20_000) / rate, digits))
    assert result == pytest.approx(rate, rel=1e-9)
