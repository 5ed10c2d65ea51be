"""Files in parts through the observer: the same bits as in one piece, in memory that does not grow."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation import observer_run
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.desk.evaluation.observer_run import HistorySamples
from observer_rt.files.replay.framing import Framer, all_samples
from observer_rt.files.signals.recording import OPTIONAL, Chunk, Recording
from observer_rt.files.signals.stream import HeldSignals, SignalStream, Stretch, cut
from observer_rt.foundation.units import Floats
from observer_rt.model.effects import effective_model
from tests.desk.evaluation.documents import recording_json
from tests.device import frames_of, later, simulated
from tests.files.canlog.log_cases import sent_log, write_log

BENCH = load_bench().exact
C = effective_model(BENCH.injector.parameters).coefficients


def worn() -> Recording:
    return simulated(4, 0.3, (60e6, 120e6), 100e3, seed=3, measured_rate=True)


def streamed(source: SignalStream, *traces: Path) -> Evaluation:
    return evaluate(BENCH, [source], traces=traces).evaluations[0]


class Cut(SignalStream):
    def __init__(self, recording: Recording, bounds: list[int], at_once: int) -> None:
        super().__init__(recording.path)
        self._recording, self._bounds, self._at_once = recording, bounds, at_once
        self.sample_rate = recording.sample_rate
        self.optional = tuple(name for name in OPTIONAL if name in recording.signals)
        pairs = list(pairwise(bounds))
        self.stretches = tuple(Stretch(float(recording.time[a]), b - a) for a, b in pairs)

    def chunks(self) -> Iterator[Chunk]:
        r = self._recording
        all_of_it = Chunk(
            r.time, r.rail_pressure, r.needle_lift, r.line_pressure, r.injection_rate, r.path, self.sample_rate
        )
        for number, (begin, end) in enumerate(pairwise(self._bounds)):
            for first in range(begin, end, self._at_once):
                part = cut(all_of_it, first, min(end, first + self._at_once))
                yield replace(part, stretch=number, first=first - begin)


def test_in_parts_as_in_one_piece(tmp_path: Path) -> None:
    recording = worn()
    traces = [tmp_path / "found.csv", tmp_path / "known.csv"]
    result = streamed(Cut(recording, [0, recording.samples], 701), traces[0])
    reference = streamed(HeldSignals(recording), traces[1])
    assert (recording_json(result, C), result.trace.size) == (recording_json(reference, C), 0)
    assert traces[0].read_bytes() == traces[1].read_bytes()


def test_stretches_are_one_history_with_a_pause_between(tmp_path: Path) -> None:
    recording = worn()
    middle = recording.samples // 2
    outcome = streamed(Cut(recording, [0, middle, recording.samples], 5000))
    halves = [Cut(recording, [a, b], 5000).collected() for a, b in ((0, middle), (middle, recording.samples))]
    reference = evaluate(BENCH, halves).evaluations
    results = [result for evaluation in reference for result in evaluation.injections]
    assert [(one.mass, one.start) for one in outcome.injections] == [(one.mass, one.start) for one in results]
    assert len(results) == 4


def test_a_restarted_device_splits_the_log(tmp_path: Path) -> None:
    frames = frames_of(BENCH, worn())
    end = frames[-1].time + 1.0
    again = later(frames, end)
    log = LoggedSignals(BENCH, write_log(tmp_path / "bus.blf", sent_log([*frames, *again])))
    assert len(log.logged) == 2
    assert any("a device was restarted" in note for note in log.notes)
    result = streamed(log, tmp_path / "trace.csv")
    reference = evaluate(BENCH, [worn()]).evaluations[0].injections
    assert len(result.injections) == 8
    assert [each.mass for each in result.injections[:4]] == [each.mass for each in reference]
    masses = np.array([each.mass for each in result.injections])
    np.testing.assert_allclose(masses[4:], masses[3], rtol=0.6)  # two pressures
    assert len((tmp_path / "trace.csv").read_text().splitlines()) == 1 + result.samples
    starts = [each.start for each in result.injections]
    assert starts == sorted(starts)
    decoded = list(log.chunks())
    assert sum(chunk.samples for chunk in decoded) == log.samples


def test_what_is_remembered_does_not_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    give = HistorySamples.give

    def watched(self: HistorySamples, first: int, time: Floats, measured_rate: Floats | None) -> None:
        give(self, first, time, measured_rate)
        sizes.append(self.held.size)

    monkeypatch.setattr(HistorySamples, "give", watched)
    monkeypatch.setattr(observer_run, "LOOK_BACK", 4096)
    recording = worn()
    assert recording.samples > 15_000
    streamed(Cut(recording, [0, recording.samples], 1000))
    assert max(sizes) < 4096 + 3000


@pytest.mark.parametrize("suffix", [".mf4", ".parquet"])
def test_a_trace_is_in_the_format_of_its_suffix(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"trace{suffix}"
    source = HeldSignals(worn())
    streamed(source, path)
    (reference,) = evaluate(BENCH, [worn()]).evaluations
    time, rate, state = _columns(path)
    np.testing.assert_allclose(time, worn().time, rtol=1e-8)
    np.testing.assert_allclose(rate, reference.trace.injection_rate / 1e-6, rtol=1e-8, atol=1e-12)
    assert set(state) == {"RUNNING_NOMINAL", "ADAPTED", "STARTING"} & set(state)
    assert "ADAPTED" in state


def _columns(path: Path) -> tuple[Floats, Floats, list[str]]:
    if path.suffix == ".mf4":
        from asammdf import MDF

        with MDF(path) as file:
            rate = file.get("injection_rate")
            assert rate.unit == "mm3/ms"
            return rate.timestamps, rate.samples, [word.decode() for word in file.get("state").samples]
    table = pyarrow.parquet.read_table(path)
    rate = table["injection_rate_mm3_per_ms"].to_numpy()
    return table["time_s"].to_numpy(), rate, table["state"].to_pylist()


@pytest.mark.slow
def test_a_log_with_long_holes_as_in_one_piece(tmp_path: Path) -> None:
    """Holes longer than the observer remembers: a row of the trace for every sample all the same."""
    framer = Framer(map_bus(BENCH))
    frames, begin = [], 0.0
    for _ in range(3):
        frames += [frame._replace(time=frame.time + begin) for frame in framer.frames(worn(), all_samples(worn()))]
        framer.pause(100_000)
        begin = framer.next_index / 100e3
    log = LoggedSignals(BENCH, write_log(tmp_path / "bus.blf", sent_log(frames)))
    assert len(log.logged) == 1
    result = streamed(log, tmp_path / "trace.csv")
    rows = np.genfromtxt(tmp_path / "trace.csv", delimiter=",", skip_header=1)
    assert len(rows) == result.samples
    np.testing.assert_allclose(rows[:, 0], np.arange(len(rows)) / 100e3, rtol=1e-8)
    is_known = np.isfinite(rows[:, 1])
    begins = np.flatnonzero(np.diff(is_known) > 0)
    assert sum(is_known[first : first + 100_000].any() for first in begins) >= 3
    reference = evaluate(BENCH, [worn()] * 3).evaluations
    masses = [report.mass for evaluation in reference for report in evaluation.reports]
    assert [result.mass for result in result.injections] == masses
