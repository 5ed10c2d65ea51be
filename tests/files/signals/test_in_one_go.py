"""A file that is checked while it is read says in the end what one says that was looked through before."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.formats import open_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, joined
from observer_rt.files.signals.table_signals import OtherRateError
from observer_rt.foundation.errors import UserError

SAMPLES = 2 * SAMPLES_AT_ONCE + 4321


def measured(samples: int = SAMPLES) -> Recording:
    """At 100 kHz, with missing values."""
    random = np.random.default_rng(1)
    lift = np.where(np.arange(samples) % 4000 < 100, 200e-6, 0.0)
    lift[::97] = np.nan
    return Recording(
        np.arange(samples) / 1e5,
        100e6 + 1e5 * random.normal(size=samples),
        lift,
        100e6 + 1e5 * random.normal(size=samples),
        random.normal(size=samples) * 1e-6,
    )


def stretched() -> Recording:
    """With a clock that gets slower, by too little for any two samples to tell."""
    recording = measured()
    late = np.maximum(np.arange(SAMPLES) - SAMPLES_AT_ONCE, 0) * 2e-10
    return replace(recording, time=recording.time + late)


@pytest.mark.parametrize("suffix", [".csv", ".mf4", ".parquet"])
def test_the_same_samples_and_the_same_said_of_them(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"measured{suffix}"
    write_recording(path, measured())
    known, found = open_recording(path), open_recording(path, in_one_go=True)
    assert (found.sample_rate, found.has_rate) == (known.sample_rate, True)
    read, expected = joined(list(found.chunks())), joined(list(known.chunks()))
    for name, values in expected.signals.items():
        np.testing.assert_array_equal(read.signals[name], values)
    np.testing.assert_array_equal(read.time, expected.time)
    assert found.stretches == known.stretches
    assert found.survey.signals == known.survey.signals
    assert found.survey.openings.most == known.survey.openings.most == 10


@pytest.mark.parametrize(
    ("suffix", "row"), [(".csv", SAMPLES_AT_ONCE - 1), (".mf4", SAMPLES_AT_ONCE), (".parquet", SAMPLES - 2)]
)
def test_a_gap_is_the_same_wherever_it_is(tmp_path: Path, suffix: str, row: int) -> None:
    path = tmp_path / f"gap{suffix}"
    recording = measured()
    time = recording.time + 0.5 * (np.arange(SAMPLES) >= row)
    write_recording(path, recording)  # whose time is even, which is asked of what is written
    whole = open_recording(path).collected()
    object.__setattr__(whole, "time", time)
    write_recording(path, whole)
    with pytest.raises(UserError, match="gap in time") as known:
        open_recording(path)
    with pytest.raises(UserError) as found:
        list(open_recording(path, in_one_go=True).chunks())
    assert str(found.value) == str(known.value)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_rate_that_only_the_whole_file_tells(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"stretched{suffix}"
    write_recording(path, stretched())
    assert open_recording(path).sample_rate < 99_999.5
    found = open_recording(path, in_one_go=True)
    assert found.sample_rate == 1e5
    with pytest.raises(OtherRateError):
        list(found.chunks())
