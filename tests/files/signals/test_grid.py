"""Foreign stamps on an even grid: jitter, other rates, gaps, restarts, several time axes."""

from pathlib import Path

import numpy as np
import pyarrow
import pytest
from asammdf import Signal
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from observer_rt.config.injector_sections import Meaning
from observer_rt.files.signals import csv_table, mapped_signals, mdf4_table, stream
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from tests.files.signals.foreign import RATE, bench, opened, read, signals, write_rows
from tests.files.signals.test_mdf4_channels import write as mdf4


def test_jittered_stamps_are_taken_for_the_grid(tmp_path: Path) -> None:
    jitter = np.random.default_rng(1).uniform(-1e-6, 1e-6, 500)
    stream = opened(write_rows(tmp_path, np.arange(500) / RATE + jitter), tmp_path)
    recording = stream.collected()
    np.testing.assert_array_equal(recording.needle_lift, np.arange(500) % 100 * 1e-6)
    assert recording.sample_rate == RATE
    assert any("are taken for it" in note for note in stream.notes)


def test_a_short_gap_is_bridged_and_told(tmp_path: Path) -> None:
    kept = np.delete(np.arange(500), [200, 201, 202])
    stream = opened(write_rows(tmp_path, kept / RATE, lift=kept.astype(np.float64)), tmp_path)
    assert any("1 gaps are bridged" in note for note in stream.notes)
    np.testing.assert_allclose(stream.collected().needle_lift, np.arange(500) * 1e-6, rtol=1e-9)


def test_a_long_gap_splits(tmp_path: Path) -> None:
    kept = np.delete(np.arange(500), range(200, 230))
    stream = opened(write_rows(tmp_path, kept / RATE), tmp_path)
    assert [part.samples for part in stream.stretches] == [200, 270]
    assert stream.stretches[1].start == pytest.approx(230 / RATE)
    assert any("split into 2 stretches: after 0.00199 s 0.00031 s are missing" in note for note in stream.notes)
    joined = stream.collected()
    assert joined.samples == 500
    assert np.flatnonzero(np.isnan(joined.rail_pressure)).tolist() == list(range(200, 230))
    wider = opened(write_rows(tmp_path, kept / RATE), tmp_path, "bridge_ms = 1.0")
    assert len(wider.stretches) == 1


def test_a_restart_splits(tmp_path: Path) -> None:
    stream = opened(write_rows(tmp_path, np.concatenate((np.arange(300) / RATE, np.arange(200) / RATE))), tmp_path)
    assert [part.samples for part in stream.stretches] == [300, 200]
    assert any("the time begins anew" in note for note in stream.notes)
    lifts = [chunk.needle_lift for chunk in stream.chunks()]
    np.testing.assert_array_equal(np.concatenate(lifts), np.arange(500) % 100 * 1e-6)


@pytest.mark.parametrize("rate", [50e3, 100.003e3])
def test_means_are_not_resampled(tmp_path: Path, rate: float) -> None:
    path = write_rows(tmp_path, np.arange(20_000) / rate)
    with pytest.raises(UserError, match=r"cannot be resampled\n.*set sampling\.rate_hz to the rate of the file"):
        opened(path, tmp_path, 'meaning = "mean"')
    assert opened(write_rows(tmp_path, np.arange(500) / RATE), tmp_path, 'meaning = "mean"').meaning is Meaning.MEAN
    assert opened(path, tmp_path).meaning is Meaning.INSTANT


@pytest.mark.parametrize("rate", [48e3, 250e3])
def test_another_rate_is_resampled(tmp_path: Path, rate: float) -> None:
    time = np.arange(20_000) / rate
    stream = opened(write_rows(tmp_path, time, lift=time * 1e4), tmp_path)
    recording = stream.collected()
    assert recording.sample_rate == RATE
    np.testing.assert_allclose(recording.needle_lift, recording.time * 1e-2, atol=1e-9)
    assert any("resampled" in note for note in stream.notes)


def test_time_in_another_unit_falls_apart_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="unit of the time"):
        opened(write_rows(tmp_path, np.arange(500.0)), tmp_path)


@given(
    seed=st.integers(0, 2**32 - 1),
    gaps=st.lists(st.tuples(st.integers(60, 498), st.integers(1, 40)), max_size=5),
    restarts=st.lists(st.integers(60, 499), max_size=2),
    at_once=st.integers(50, 350),
)
def test_in_parts_as_in_one_piece(
    tmp_path: Path, seed: int, gaps: list[tuple[int, int]], restarts: list[int], at_once: int
) -> None:
    """However small the parts are that are read: the same samples, none lost, none twice."""
    random = np.random.default_rng(seed)
    time: Floats = np.arange(500) / RATE
    for position, lost in gaps:
        time[position:] += lost / RATE
    for position in restarts:
        time[position:] -= time[position]
    jitter: Floats = random.uniform(-2e-6, 2e-6, 500)
    path = write_rows(tmp_path, (time + jitter).astype(np.float64))
    complete = list(opened(path, tmp_path).chunks())
    with pytest.MonkeyPatch.context() as patch:
        for module in (stream, csv_table, mapped_signals):
            patch.setattr(module, "SAMPLES_AT_ONCE", at_once)
        result = opened(path, tmp_path)
        parts = list(result.chunks())
    for name in ("time", "rail_pressure", "needle_lift", "line_pressure"):
        np.testing.assert_array_equal(
            np.concatenate([getattr(part, name) for part in parts]),
            np.concatenate([getattr(part, name) for part in complete]),
        )
    for number, stretch in enumerate(result.stretches):
        mine = [part for part in parts if part.stretch == number]
        assert sum(part.samples for part in mine) == stretch.samples
        assert [part.first for part in mine] == np.cumsum([0, *(part.samples for part in mine)])[:-1].tolist()


RASTERS = """
[recording]
[recording.rail_pressure]
column = "RailPressure"
[recording.needle_lift]
column = "Lift Sensor A"
[recording.line_pressure]
column = "p/line"
unit = "bar"
"""


@pytest.mark.parametrize("at_once", [1 << 16, 37])
def test_mdf4_channels_of_several_rasters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    for module in (mdf4_table, mapped_signals):
        monkeypatch.setattr(module, "SAMPLES_AT_ONCE", at_once)
    slow, fast = np.arange(0.0, 0.1, 1e-3), np.arange(10_000) / RATE
    path = mdf4(
        tmp_path / "x.mf4",
        [Signal(100 + slow * 10, slow, name="RailPressure", unit="MPa")],
        [
            Signal((fast * 1e4).astype(np.float32), fast, name="Lift Sensor A", unit="µm"),
            Signal(np.full(10_000, 990), fast, name="p/line", unit="MPa"),
            Signal(fast, fast, name="Unused", unit="V"),
        ],
    )
    recording = read(path, bench(tmp_path, text=RASTERS))
    assert recording.samples == 10_000
    last_time = slow[-1]
    inside = recording.time <= last_time
    np.testing.assert_allclose(recording.rail_pressure[inside], 100e6 + recording.time[inside] * 10e6, rtol=1e-9)
    assert np.isnan(recording.rail_pressure[~inside]).all()
    np.testing.assert_allclose(recording.needle_lift, fast * 1e-2, rtol=1e-6)
    assert recording.line_pressure[0] == 990e5


def test_an_mdf4_channel_in_several_groups_must_be_chosen(tmp_path: Path) -> None:
    fast = np.arange(100) / RATE
    names = ("RailPressure", "Lift Sensor A", "p/line")
    group = [Signal(np.full(100, 90.0), fast, name=name, unit="MPa") for name in names]
    group[1] = Signal(np.zeros(100), fast, name=names[1], unit="mm")
    path = mdf4(tmp_path / "x.mf4", group, [Signal(np.full(100, 70.0), fast, name="RailPressure", unit="MPa")])
    with pytest.raises(UserError, match=r"(?s)is in the groups 0, 1.*remedy: .*group = 0"):
        read(path, bench(tmp_path, text=RASTERS))
    chosen = RASTERS.replace('column = "RailPressure"', 'column = "RailPressure"\ngroup = 1')
    assert read(path, bench(tmp_path, text=chosen)).rail_pressure[0] == 70e6


def test_a_channel_of_text_is_refused(tmp_path: Path) -> None:
    fast = np.arange(100) / RATE
    group = [Signal(np.full(100, 90.0), fast, name=name, unit="MPa") for name in ("RailPressure", "p/line")]
    words = Signal(np.array([b"open"] * 100), fast, name="Lift Sensor A", unit="mm", encoding="utf-8")
    with pytest.raises(UserError, match="Lift Sensor A: holds no plain numbers"):
        read(mdf4(tmp_path / "x.mf4", [*group, words]), bench(tmp_path, text=RASTERS))


def test_parquet_with_units_in_its_metadata(tmp_path: Path) -> None:
    result = signals(300)
    kinds = {"p_Rail": result["p_Rail"].astype(np.float32), "lift": result["lift"].astype(int)}
    table = pyarrow.table({**result, "t": result["t"] * 1e3, **kinds, "word": ["a"] * 300})
    fields = [field.with_metadata({"unit": "bar"}) if field.name == "p_Rail" else field for field in table.schema]
    parquet.write_table(table.cast(pyarrow.schema(fields)), tmp_path / "x.parquet")
    recording = read(tmp_path / "x.parquet", bench(tmp_path, rail=""))
    np.testing.assert_allclose(recording.rail_pressure, result["p_Rail"] * 1e5)
    np.testing.assert_allclose(recording.needle_lift, result["lift"] * 1e-6)


def test_two_columns_of_one_name_in_parquet(tmp_path: Path) -> None:
    columns = [pyarrow.array(values) for values in signals(300).values()]
    names = ["t", "p_Rail", "lift", "p_Rail"]
    parquet.write_table(pyarrow.Table.from_arrays(columns, names), tmp_path / "x.parquet")
    with pytest.raises(UserError, match="column 'p_Rail' appears 2 times"):
        opened(tmp_path / "x.parquet", tmp_path)


@pytest.mark.parametrize("rounded", [np.round, np.floor])
def test_stamps_rounded_to_more_than_a_sample_are_to_blame(tmp_path: Path, rounded: np.ufunc) -> None:
    """Every second row would be left out, and the rest read at half the rate."""
    path = write_rows(tmp_path, rounded(np.arange(400) / 2.0) / RATE)
    with pytest.raises(UserError, match=r"(?s)its stamps are rounded.*remedy: .*\[recording\] rate_hz"):
        opened(path, tmp_path)


def test_two_rows_an_instant_are_its_limits(tmp_path: Path) -> None:
    """Of a state, and of inputs, which are held in between."""
    number = np.arange(600.0)
    state, held = number // 2, np.maximum(number - 1, 0) // 2
    path = write_rows(tmp_path, state / RATE, lift=state, p_Rail=1000 + held, p_Line=99 + held / 4)
    stream = opened(path, tmp_path)
    assert "the right one is read" in stream.notes[0]
    np.testing.assert_allclose(stream.collected().rail_pressure, 1e5 * (1000 + np.arange(300)))
