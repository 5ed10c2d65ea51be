"""A folder of evidence: bounded, by kind and operating point, whole files only, and read as any recording."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from observer_rt.config.injector_sections import EvidenceConfig
from observer_rt.engine.reports.evidence import EventEvidence, EvidenceKind
from observer_rt.files.evidence_folder import EvidenceFolder, read_evidence, write_evidence
from observer_rt.files.formats import open_recording
from observer_rt.foundation.errors import UserError

BEGIN = datetime(2026, 5, 1, tzinfo=UTC)
SAMPLES = 2000


def event(kind: EvidenceKind, number: int, pressure: float = 100e6, model: str = "ab" * 32) -> EventEvidence:
    signals = np.random.default_rng(number).normal(size=(3, SAMPLES))
    belief = {"model_sha256": model, "injections": [{"number": number}]}
    return EventEvidence(kind, number, 1000 * number, 1e5, pressure, 1.2e-3, belief, signals)


def numbers(folder: Path) -> list[int]:
    return sorted(read_evidence(path).belief["injections"][0]["number"] for path in folder.glob("*.parquet"))


def fill(folder: Path, events: list[EventEvidence], most_mib: float = 100.0, per_point: int = 3) -> None:
    """Keep events, one a second, by a writer that is started anew in the middle."""
    for part in (events[: len(events) // 2], events[len(events) // 2 :]):
        keeper = EvidenceFolder(folder, EvidenceConfig(most_mib=most_mib, per_point=per_point))
        for event in part:
            keeper.take(event, BEGIN + timedelta(seconds=event.event))


@pytest.mark.parametrize("per_point", [3, 8])
def test_refused_events_are_the_newest_of_each_operating_point(tmp_path: Path, per_point: int) -> None:
    fill(tmp_path, [event(EvidenceKind.REFUSED, n, (60e6, 100e6)[n % 2]) for n in range(20)], per_point=per_point)
    assert numbers(tmp_path) == [*range(20 - 2 * per_point, 20)]


@pytest.mark.parametrize("kind", EvidenceKind)
def test_no_event_is_dropped_while_there_is_room(tmp_path: Path, kind: EvidenceKind) -> None:
    fill(tmp_path, [event(kind, n) for n in range(8)], per_point=8)
    assert numbers(tmp_path) == [*range(8)]


def test_good_events_are_a_fair_sample(tmp_path: Path) -> None:
    """Each of many has the chance of any other: over many folders first and last halves are kept alike."""
    kept = []
    for trial in range(30):
        folder = tmp_path / str(trial)
        fill(folder, [event(EvidenceKind.GOOD, n) for n in range(12 * trial, 12 * trial + 12)])
        assert len(numbers(folder)) == 3
        kept += [number - 12 * trial for number in numbers(folder)]
    assert 0.3 < np.mean(np.array(kept) < 6) < 0.7
    assert len(set(kept)) > 8


def test_good_events_are_a_fair_sample_where_the_size_of_the_folder_limits_them(tmp_path: Path) -> None:
    fill(tmp_path, [event(EvidenceKind.GOOD, n) for n in range(60)], most_mib=1.0, per_point=1000)
    assert min(numbers(tmp_path)) < 20


def test_another_model_has_a_sample_of_its_own(tmp_path: Path) -> None:
    """However long the one before was in force."""
    fill(tmp_path, [event(EvidenceKind.GOOD, n) for n in range(30)])
    fill(tmp_path, [event(EvidenceKind.GOOD, n, model="cd" * 32) for n in range(30, 33)])
    assert (numbers(tmp_path)[-3:], len(numbers(tmp_path))) == ([30, 31, 32], 6)


def test_the_folder_is_bounded_and_keeps_what_there_is_least_of(tmp_path: Path) -> None:
    many = [event(EvidenceKind.REFUSED, n, 60e6) for n in range(30)]
    fill(tmp_path, [event(EvidenceKind.REFUSED, 99, 140e6), *many], most_mib=1.0, per_point=1000)
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    assert 0.8 * 2**20 < size <= 2**20
    assert {29, 99} <= set(numbers(tmp_path))


def test_an_event_comes_back_to_the_bit_and_reads_as_a_recording(tmp_path: Path) -> None:
    written = event(EvidenceKind.DOUBTFUL, 3)
    written.signals[1, 10:20] = np.nan
    write_evidence(tmp_path / "one.parquet", written, "2026-05-01T00:00:00.000+00:00")
    kept = read_evidence(tmp_path / "one.parquet")
    assert (kept.kind, kept.belief, kept.open_time) == (written.kind, written.belief, written.open_time)
    for name, values in zip(("rail_pressure", "needle_lift", "line_pressure"), written.signals, strict=True):
        np.testing.assert_array_equal(kept.recording.arrays[name], values)
    assert kept.recording.time[0] == pytest.approx(written.first_index / written.sample_rate)
    assert open_recording(tmp_path / "one.parquet").grid_samples == SAMPLES


def test_files_of_somebody_else_stay_in_a_folder_that_is_full(tmp_path: Path) -> None:
    names = (".mine.parquet", "refused_100MPa_1200us_mine.parquet", "fleet_2026.parquet")
    for name in names:
        (tmp_path / name).write_bytes(b"PAR1" + bytes(2 << 20))
    fill(tmp_path, [event(EvidenceKind.REFUSED, number) for number in range(1, 6)], most_mib=1.0)
    assert [name for name in names if not (tmp_path / name).exists()] == []


def test_what_a_killed_writer_left_is_gone_and_what_is_damaged_is_refused(tmp_path: Path) -> None:
    left = tmp_path / ".refused_100MPa_1200us_abcdef01_20260501T000000000000.0123abcd.part.parquet"
    left.write_bytes(b"PAR1")
    fill(tmp_path, [event(EvidenceKind.REFUSED, 1)])
    assert not left.exists()
    (path,) = tmp_path.glob("*.parquet")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(UserError, match="damaged"):
        read_evidence(path)
    table = pyarrow.table({name: np.arange(2 << 20) / 1e5 for name in parquet.read_schema(path).names})
    parquet.write_table(table.replace_schema_metadata(parquet.read_schema(path).metadata), tmp_path / "long")
    path.write_bytes(b"something else")
    os.mkfifo(tmp_path / "pipe")
    for other in (path, tmp_path / "long", tmp_path / "pipe", tmp_path):
        with pytest.raises(UserError, match="no evidence"):
            read_evidence(other)
