"""Choosing the format by suffix, and the file errors a user can meet."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from observer_rt.files.formats import is_log, read_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError

CODES = st.integers(0, 0xFFFD)


def _signal(draw: st.DrawFn, samples: int, lowest: int, multiple: float, divisor: float) -> NDArray[np.float64]:
    values = (draw(hnp.arrays(np.int64, samples, elements=CODES)) + lowest) * multiple / divisor
    return np.where(draw(hnp.arrays(np.bool_, samples, elements=st.booleans())), np.nan, values)


@st.composite
def quantised_recordings(draw: st.DrawFn) -> Recording:
    """Recordings whose values lie on the 16-bit grids of the bus, with a time in steps of 1e-7 s."""
    samples = draw(st.integers(2, 30))
    start = draw(st.integers(0, 10**9))
    period = draw(st.integers(10, 10_000))
    lift = _signal(draw, samples, -5000, 1.0, 1e8)
    energizing = _signal(draw, samples, 0, 1.0, 1.0) if draw(st.booleans()) else None
    return Recording(
        time=(start + period * np.arange(samples)) / 1e7,
        rail_pressure=_signal(draw, samples, -2000, 5000.0, 1.0),
        needle_lift=lift if energizing is None or draw(st.booleans()) else np.full(samples, np.nan),
        line_pressure=_signal(draw, samples, -2000, 5000.0, 1.0),
        injection_rate=_signal(draw, samples, -10_000, 1.0, 1e8) if draw(st.booleans()) else None,
        energizing=energizing,
    )


def same(left: Recording, right: Recording) -> bool:
    return (
        np.array_equal(left.time, right.time)
        and left.signals.keys() == right.signals.keys()
        and all(np.array_equal(values, right.signals[name], equal_nan=True) for name, values in left.signals.items())
    )


RECORDING = Recording(np.arange(10) / 1e5, np.ones(10), np.ones(10) * 1e-4, np.ones(10) * 2e6)


def test_a_damaged_page_of_our_parquet_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "recording.parquet"
    write_recording(path, RECORDING)
    data = bytearray(path.read_bytes())
    data[data.find(np.float64(2e6).tobytes())] ^= 1
    path.write_bytes(data)
    with pytest.raises(UserError, match="CRC"):
        read_recording(path)


@pytest.mark.parametrize("suffix", [".csv", ".CSV", ".mf4"])
@given(recording=quantised_recordings())
def test_round_trip_is_exact(tmp_path: Path, suffix: str, recording: Recording) -> None:
    """And what was read gives the same bytes again."""
    path = tmp_path / f"recording{suffix}"
    write_recording(path, recording)
    first = path.read_bytes()
    again = read_recording(path)
    assert same(again, recording)
    write_recording(path, again)
    assert path.read_bytes() == first


@pytest.mark.parametrize("suffix", [".csv", ".mf4"])
def test_a_file_or_folder_that_is_not_there(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(UserError, match="no such file"):
        read_recording(tmp_path / f"absent{suffix}")
    with pytest.raises(UserError, match="no such file or folder"):
        write_recording(tmp_path / "absent" / f"a{suffix}", RECORDING)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(UserError, match=r"cannot be opened(?s:.*)parts in a folder must be joined"):
        read_recording(tmp_path / "folder.csv")


def test_a_device_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    (tmp_path / "full.csv").symlink_to("/dev/full")
    with pytest.raises(UserError, match="is no file"):
        write_recording(tmp_path / "full.csv", RECORDING)
    assert Path("/dev/full").is_char_device()


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("a", r"known suffixes: \.csv, \.mf4"),
        ("a.xlsx", r"save it as a\.csv, or read it by pandas"),
        ("a.mat", "read it by pandas"),
        ("a.mdf", r'convert\("4\.10"\)\.save\("a\.mf4"\)'),
        ("a.pkl", r'to_parquet\("a\.parquet"\)'),
        ("a.MFC", "mdf2finalized"),
        ("a.lvm", r"name it a\.txt"),
        ("a.mf4.gz", r"unpack it first: gunzip a\.mf4\.gz"),
        ("a.log.zst", "unpack it first"),
    ],
)
def test_kinds_that_are_met_but_not_read_have_a_remedy_of_their_own(tmp_path: Path, name: str, advice: str) -> None:
    for read in (is_log, read_recording, lambda path: write_recording(path, RECORDING)):
        with pytest.raises(UserError, match=rf"unknown kind of file(?s:.*){advice}"):
            read(tmp_path / name)
