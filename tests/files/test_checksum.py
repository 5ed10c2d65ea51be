"""Files of ours that tell damage: any bit of them, a changed length; files of others have no such text."""

import random
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from asammdf import MDF
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from observer_rt.files.checksum import BLANK, refuse_damaged, seal
from observer_rt.files.formats import open_log, open_recording, read_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import mixture, write_log


def content(path: Path) -> object:
    if path.stem == "bus":
        return list(open_log(path))
    return [values.tolist() for values in read_recording(path).arrays.values()]


@cache
def whole(name: str) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        if path.stem == "bus":
            write_log(path, mixture(path.suffix, 12))
        else:
            values = np.arange(20.0)
            write_recording(path, Recording(values / 1e5, values * 1e5, values * 1e-6, values * 1e5))
        return path.read_bytes()


@pytest.mark.parametrize("name", ["recording.mf4", "recording.parquet", "bus.mf4"])
def test_no_bit_of_what_we_write_is_read_otherwise(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(whole(name))
    expected = content(path)

    @settings(max_examples=min(settings().max_examples, 40))
    @given(st.integers(0, 8 * len(whole(name)) - 1))
    def check(bit: int) -> None:
        damaged = bytearray(whole(name))
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        found: object = None
        refusal = path.name
        try:
            found = content(path)
        except UserError as error:
            refusal = str(error)
        assert found in (None, expected)
        assert path.name in refusal

    check()


@given(st.binary(max_size=3000), st.binary(max_size=300), st.integers(0))
def test_a_sealed_file_is_whole_and_with_any_other_bit_is_not(
    before: bytes, after: bytes, place: int
) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_bytes(before + BLANK.encode() + after)
        seal(path)
        assert refuse_damaged(path) == ()
        sealed = bytearray(path.read_bytes())
        assert sealed[: len(before)] == before
        assert sealed[len(before) + len(BLANK) :] == after
        bit = place % (8 * (len(before) + len(after)) or 1)
        at = bit // 8 if bit < 8 * len(before) else bit // 8 + len(BLANK)
        if before or after:
            sealed[at] ^= 1 << bit % 8
            path.write_bytes(sealed)
            with pytest.raises(UserError, match="is damaged: its bytes contradict its checksum"):
                refuse_damaged(path)


@pytest.mark.parametrize(
    ("change", "length"), [(lambda data: data + b"x", 1), (lambda data: data[1:], -1)], ids=["more", "less"]
)
def test_another_length_is_told(tmp_path: Path, change: Callable[[bytes], bytes], length: int) -> None:
    path = tmp_path / "file"
    path.write_bytes(bytes(1000) + BLANK.encode())
    seal(path)
    size = path.stat().st_size
    path.write_bytes(change(path.read_bytes()))
    (said,) = refuse_damaged(path)
    assert f"it had {size} bytes when observer-rt wrote it, and has {size + length}" in said


def test_what_another_program_saved_is_read_and_that_is_told(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "recording.mf4", tmp_path / "saved.mf4"
    ours.write_bytes(whole(ours.name))
    with MDF(ours) as file:
        file.save(theirs)
    stream = open_recording(theirs)
    assert content(theirs) == content(ours)
    assert ["changed by another program" in note for note in stream.notes] == [True]
    assert open_recording(ours).notes == ()


def test_a_file_of_others_has_none(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(random.Random(1).randbytes(5000))
    assert refuse_damaged(path) == ()


def test_a_page_of_parquet_that_another_program_wrote_is_checked(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "recording.parquet", tmp_path / "theirs.parquet"
    ours.write_bytes(whole(ours.name))
    table = parquet.read_table(ours)
    parquet.write_table(table, theirs, write_page_checksum=True, compression="none", use_dictionary=False)
    data = bytearray(theirs.read_bytes())
    data[data.find(np.float64(7e5).tobytes())] ^= 1
    theirs.write_bytes(data)
    with pytest.raises(UserError, match="CRC"):
        read_recording(theirs)
