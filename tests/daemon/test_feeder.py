"""Links that the loop cannot read itself: fed to it frame by frame, its rates sent for it; the latency of these."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import BusDownError, Frame, LinkDownError
from observer_rt.config.bench import load_bench
from observer_rt.core.frames.frames import LATENCIES, PUMP
from observer_rt.daemon.pump import latency_of
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.errors import RunError
from tests.benches import SAMPLE_RATE
from tests.bus.extended_bench import write_extended_bench
from tests.daemon.end_to_end import RATE, payloads
from tests.daemon.participants import PumpRun, ScriptedLink, TroubledLink, until
from tests.device import core_of, frames_of, worn_recording

BEGIN = 1_700_000_000_000_000_000  # ns
FRAMES = 600


def device_frames(bench: Path) -> list[TimedFrame]:
    return frames_of(bench, worn_recording(2))


def published(bench: Path) -> list[bytes]:
    return payloads(evaluate(load_bench(bench), [worn_recording(2)]).frames, RATE)


def test_stamps_are_kept_to_the_nanosecond(tmp_path: Path) -> None:
    """The clock of frames without an index, that of the stamps, is that of the core alone."""
    without_index = write_extended_bench(tmp_path)
    without_index.write_text(f"{without_index.read_text()}[sampling]\nrate_hz = {SAMPLE_RATE}\n")

    class StampingLink(TroubledLink):
        def receive(self, timeout_s: float) -> Frame | None:
            frame = super().receive(timeout_s)
            return frame and frame._replace(stamp_ns=next(stamps))

    wanted = [BEGIN + 20_000 * n + n * 7919 % 1013 for n in range(FRAMES)]
    stamps = iter(wanted)
    frames = device_frames(without_index)[:FRAMES]
    alone = core_of(without_index)
    for frame, stamp in zip(frames, wanted, strict=True):
        alone.handle(frame.frame_id, frame.is_extended, frame.payload, stamp)
    with PumpRun(without_index, StampingLink(frames)) as run:
        run.serve_until_taken(FRAMES)
    clocks, expected = (core.compiled.pipeline.keeping.clocks for core in (run.core, alone))
    assert clocks.tobytes() == expected.tobytes()
    assert run.core.processed == alone.processed > 0


def test_rates_that_found_no_room_are_handed_over_in_order(bench: Path) -> None:
    frames = device_frames(bench)
    link = TroubledLink(frames, has_room=False)
    with PumpRun(bench, link) as run:
        handed = [*run.serve_until_taken(len(frames)), *run.pump.finish()]
    assert payloads(handed, RATE) == published(bench)
    assert not link.sent
    assert not run.unsent


def test_some_sent_then_none_lost(bench: Path) -> None:
    """A driver that takes every other frame: what it has not taken by the end is handed over behind the others."""

    class HaltingLink(TroubledLink):
        def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
            self.has_room = not self.has_room and len(self.sent) < 100
            return super().try_send(frame_id, payload, is_extended, is_fd)

    frames = device_frames(bench)
    link = HaltingLink(frames)
    with PumpRun(bench, link) as run:
        handed = [*run.serve_until_taken(len(frames)), *run.pump.finish()]
    assert 0 < len(link.sent) <= 100
    assert payloads(link.sent, RATE) + payloads(handed, RATE) == published(bench)


def test_rates_on_their_way_to_a_link_that_goes_down_are_counted(bench: Path) -> None:
    frames = device_frames(bench)
    link = TroubledLink(frames, has_room=False)
    with PumpRun(bench, link) as run:
        run.serve_until_taken(len(frames))
        link.plugged.clear()
        with pytest.raises(BusDownError, match="can5 is down") as raised:
            until(lambda: bool(run.pump.serve(1e-3)))
        run.pump.leave_out(raised.value.bus)
        handed = run.pump.finish()
    assert sum(run.unsent) + len(payloads(handed, RATE)) == len(published(bench))
    assert sum(run.unsent) > 100


def test_it_is_served_again_once_it_is_back(bench: Path) -> None:
    frames = device_frames(bench)
    link = TroubledLink(frames[:FRAMES])
    with PumpRun(bench, link) as run:
        for first in (FRAMES, 2 * FRAMES):
            run.serve_until_taken(first)
            link.plugged.clear()
            with pytest.raises(BusDownError):
                until(lambda: bool(run.pump.serve(1e-3)))
            run.pump.leave_out(0)
            run.pump.serve(0.0)
            link.plugged.set()
            link.deliver(frames[first : first + FRAMES])
            run.pump.take_back(0)
        run.serve_until_taken(min(3 * FRAMES, len(frames)))
    assert run.core.counters.lost_samples == 0


@pytest.mark.parametrize("failure", [RunError("broken"), ZeroDivisionError("in the driver"), LinkDownError("gone")])
def test_what_ends_it_is_raised_behind_the_frames_that_came(bench: Path, failure: Exception) -> None:
    frames = device_frames(bench)[:FRAMES]
    with PumpRun(bench, ScriptedLink(frames, failure)) as run:
        with pytest.raises((type(failure), BusDownError), match=str(failure)):
            until(lambda: bool(run.pump.serve(1e-3)))
        assert run.core.counters.frames == FRAMES


def test_it_ends_while_frames_wait(bench: Path) -> None:
    """The loop waits for a verdict that nobody gives, the pair is full, and more frames are in the driver."""
    link = TroubledLink(device_frames(bench))
    with PumpRun(bench, link) as run:
        until(lambda: bool(run.core.compiled.observer.memory[0]["judgement"]["waiting"]))
        assert run.ends()
        assert not link.empty.is_set()


def test_other_results_come_behind_the_rates(bench: Path) -> None:
    link = TroubledLink(device_frames(bench)[:FRAMES], has_room=False)
    with PumpRun(bench, link) as run:
        run.serve_until_taken(FRAMES)
        until(lambda: run.core.counters.frames == FRAMES)
        assert run.pump.sender(0).try_send(0x321, b"other", False, True)
        link.has_room = True
        until(lambda: bool(link.sent) and link.sent[-1].payload == b"other")
    assert len(link.sent) > 100
    assert link.sent[-1].frame_id == 0x321


def counted(latencies: list[int]) -> Any:
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
