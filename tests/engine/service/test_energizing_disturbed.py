"""Commands without openings, and what must not look like one: losses, pauses, restarts."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.core.frames.frames import READINGS
from observer_rt.desk.simulation.schedule import Shot
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.benches import SAMPLE_RATE
from tests.daemon.pulses import (
    MAIN,
    PILOT_AND_MAIN,
    SOURCES,
    EnergizingBy,
    Pulses,
    blocks,
    duration_frame,
    durations,
    index_at,
    injected,
    misfired,
    on_change,
    pulse_bench,
    safe_blocks,
    safe_durations,
    samples,
    watch,
)
from tests.device import core_of, damaged, later, merged, run

Sent = Recording | Iterable[TimedFrame]
Energized = tuple[list[int | None], list[int]]
"""Commands of the injections, commands missing."""
every_kind = pytest.mark.parametrize("kind", ["level", "block", "by stamp"])


def stuck(recording: Recording, since: float) -> Recording:
    lift = recording.needle_lift.copy()
    lift[round(since * SAMPLE_RATE) :] = lift[round(since * SAMPLE_RATE)]
    return replace(recording, needle_lift=lift)


ANY_SOURCE: dict[
    str, tuple[int, tuple[Shot, ...], Callable[[Pulses, Recording], tuple[Recording, Pulses]], Energized]
] = {
    "pilot and main have a command each": (2, PILOT_AND_MAIN, lambda p, r: (r, p), ([1, 2, 3, 4], [])),
    "a misfire is missing": (*(3, MAIN, lambda p, r: (misfired(r, (p[1][0], p[1][0] + 5e-3)), p)), ([1, 3], [2])),
    "a pilot that misfires leaves the main its command": (
        *(2, PILOT_AND_MAIN, lambda p, r: (misfired(r, (p[0][0], p[1][0])), p)),
        ([2, 3, 4], [1]),
    ),
    "an opening nobody asked for": (3, MAIN, lambda p, r: (r, [p[0], p[2]]), ([1, None, 2], [])),
    "nothing is missing before the first command": (*(3, MAIN, lambda p, r: (r, p[2:])), ([None, None, 1], [])),
    "a needle stuck open misses nothing": (*(3, MAIN, lambda p, r: (stuck(r, p[0][0] + 1.2e-3), p)), ([1], [])),
}


@every_kind
@pytest.mark.parametrize("case", ANY_SOURCE)
def test_whatever_tells_of_the_energizing(tmp_path: Path, case: str, kind: str) -> None:
    injections, shots, change, expected = ANY_SOURCE[case]
    lines, source = SOURCES[kind]
    pulses, recording = injected(injections, shots)
    sent, energizing_frames = change(pulses, recording)
    watched = watch(pulse_bench(tmp_path, lines), sent, source(energizing_frames))
    assert watched.energized == expected
    if shots is PILOT_AND_MAIN and len(expected[0]) == 4:
        assert [report.event for report in watched.reports] == [1, 1, 2, 2]


@dataclass(frozen=True)
class Case:
    """Commands that the test bed sends for some injections, and the reports expected; sent: if not all samples."""

    lines: str
    commands: Callable[[Pulses], list[TimedFrame]]
    expected: Energized
    injections: int = 4
    shots: tuple[Shot, ...] = MAIN
    sent: Callable[[Recording, Pulses], Sent] = lambda recording, _: recording
    crc_errors: int = 0


def repeated(pulses: Pulses) -> list[TimedFrame]:
    """A duration with an index may be sent cyclically, until the next; one that was overtaken."""
    sent = [duration_frame(lasts, start + n * 5e-3, index_at(start)) for start, lasts in pulses for n in range(9)]
    second = pulses[1][0]
    return merged(sent, [duration_frame(1.1e-3, second + 1e-3, index_at(second - 5e-3))])


def with_one_late(pulses: Pulses) -> list[TimedFrame]:
    """The second comes after its injection was reported."""
    first, second, *others = durations(pulses)
    return [first, *later([second], 45e-3), *others]


def spoilt(pulses: Pulses) -> list[TimedFrame]:
    """The first comes twice, the second is damaged: a lost one."""
    first, second, *others = safe_durations(pulses)
    return [first, *later([first], 10e-3), damaged(second, 30), *others]


def without(frames: Sequence[TimedFrame], begin: float, end: float) -> list[TimedFrame]:
    return [one for one in frames if not begin <= one.time < end]


def windows(pulses: Pulses, second: float = 5e-3) -> list[tuple[float, float]]:
    """Spans [s] round the openings; the second ends so long after its command."""
    return [(start - 1.5e-3, start + (second if n == 1 else 5e-3)) for n, (start, _) in enumerate(pulses)]


CASES = {
    "a needle that bounces has no second command": Case(  # nor one with the command of a misfired pilot
        *(EnergizingBy.LEVEL, on_change, ([1, 2, 4, None], [3]), 2, PILOT_AND_MAIN),
        sent=lambda r, p: misfired(r, (p[2][0], p[3][0]), (p[3][0] + 0.9e-3, p[3][0] + 0.9e-3 + 0.2e-3)),
    ),
    "an opening after missing_after_ms is not the command's": Case(
        EnergizingBy.LEVEL + "missing_after_ms = 0.2\n", on_change, ([None, None], [1, 2]), 2
    ),
    "a damaged frame is a lost one, a repeated one none": Case(
        EnergizingBy.SAFE, spoilt, ([1, None, 2, 3], []), crc_errors=1
    ),
    "a pulse generator that restarts costs nothing": Case(
        EnergizingBy.SAFE, lambda p: [*safe_durations(p[:2]), *safe_durations(p[2:])], ([1, 2, 3, 4], [])
    ),
    "repeated and overtaken frames are no command": Case(EnergizingBy.TIME, repeated, ([1, 2, 3], []), 3),
    "a command may come long after its samples": Case(  # an index places them
        EnergizingBy.TIME, lambda p: later(durations(p), 20e-3), ([1, 2, 3], []), 3
    ),
    "a command after its report is not missing too": Case(EnergizingBy.TIME, with_one_late, ([1, None, 3, 4], [])),
    # when energizing started is not known, nor whether it had an injection
    "a level that was high before the first frame misses nothing": Case(
        *(EnergizingBy.LEVELS_IN_BLOCK, lambda p: blocks(p, p[1][0] + 0.4e-3, 0.3), ([None, 1], []), 3),
        sent=lambda r, p: misfired(r, (p[1][0], p[1][0] + 5e-3)),
    ),
    # the needle is shut in a legal pause; so it is where one begins 2 ms after a command
    "a window that ends in a pause is seen": Case(
        EnergizingBy.LEVEL,
        on_change,
        ([1, 3], [2]),
        injections=3,
        sent=lambda r, p: samples(misfired(r, windows(p, 2e-3)[1]), *windows(p, 2e-3)),
    ),
    # in the pause before its window an injection had no command; not so if blocks were lost
    "protected blocks of a windowed source tell of a pause": Case(
        EnergizingBy.SAFE_BLOCK,
        lambda p: safe_blocks([*p[:2], p[3]], *windows(p)),
        ([1, 2, None, 3], []),
        sent=lambda r, p: samples(r, *windows(p)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_which_openings_are_commanded_and_which_commands_missing(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    pulses, recording = injected(case.injections, case.shots)
    watched = watch(pulse_bench(tmp_path, case.lines), case.sent(recording, pulses), case.commands(pulses))
    assert watched.energized == case.expected
    assert watched.core.counters.missing_injections == len(case.expected[1])
    assert watched.core.counters.crc_errors == case.crc_errors


@every_kind
@pytest.mark.parametrize("lost", [(-0.5e-3, 3e-3), (0.2e-3, 0.6e-3), (0.6e-3, 0.8e-3)])
def test_lost_samples_are_no_misfire(tmp_path: Path, kind: str, lost: tuple[float, float]) -> None:
    """The whole injection, its opening, or a part of it."""
    lines, source = SOURCES[kind]
    pulses, recording = injected(3)
    begin, end = (pulses[1][0] + edge for edge in lost)
    watched = watch(pulse_bench(tmp_path, lines), without(samples(recording), begin, end), source(pulses))
    assert watched.notes.missing == []
    assert (watched.commands[0], watched.commands[-1]) == (1, 3)
    if lost[0] < 0.32e-3 < lost[1] and len(watched.reports) == 3:
        assert watched.reports[1].commanded is not None  # its command is known, its opening was not seen
        assert np.isnan(watched.reports[1].commanded.opening_delay)


@every_kind
def test_stamps_change_nothing_where_an_index_is_carried(tmp_path: Path, kind: str) -> None:
    lines, source = SOURCES[kind]
    pulses, recording = injected(2)
    random = np.random.default_rng(1)
    frames = merged(samples(recording), source(pulses))
    bench = pulse_bench(tmp_path, lines)
    prompt = watch(bench, frames)
    late = run(bench, [one._replace(time=random.random()) for one in frames], learning=False)
    assert late.frames == prompt.frames
    if "index" in lines or "pattern" in lines:
        assert [report.commanded for report in late.reports] == [r.commanded for r in prompt.reports]
        assert late.notes.missing == prompt.notes.missing == []


@every_kind
def test_it_changes_no_result(tmp_path: Path, kind: str) -> None:
    lines, source = SOURCES[kind]
    pulses, recording = injected(2)
    bench = pulse_bench(tmp_path, lines)
    without_it = watch(bench, recording)
    assert watch(bench, recording, source(pulses)).frames == without_it.frames
    assert without_it.core.optional.energizing is not None
    assert without_it.core.optional.energizing.commands == 0


def test_of_more_commands_than_wait_for_python_the_oldest_are_lost(tmp_path: Path) -> None:
    core = core_of(pulse_bench(tmp_path, EnergizingBy.SAFE))
    energizing_frames = safe_durations([(1e-3 * n, 0.5e-3) for n in range(READINGS + 5)])
    block = block_of([BusFrame(one.bus, Frame(one.frame_id, one.payload, one.stamp_ns)) for one in energizing_frames])
    number = 0
    while number < block.frames:
        number, _ = core.compiled.take_many(block, number)
    core.attend()
    assert core.optional.energizing is not None
    assert core.optional.energizing.commands == READINGS


@pytest.mark.parametrize("first", [0, (1 << 32) - 8000])
def test_index_of_a_device_that_restarts(tmp_path: Path, first: int) -> None:
    """It counts from 0 again after two injections, once from just below the end of the count."""
    pulses, recording = injected(2)
    length = recording.samples / SAMPLE_RATE
    sent = [*samples(recording, index=first), *later(samples(recording), length)]
    energizing_frames = on_change(pulses, first), later(on_change(pulses), length)
    assert watch(pulse_bench(tmp_path, EnergizingBy.LEVEL), sent, *energizing_frames).energized == ([1, 2, 3, 4], [])


def test_a_command_cut_off_by_a_restart_is_never_missing(tmp_path: Path) -> None:
    """Nor when the new count comes to where the old one ended, the needle shut."""
    ((start, lasts), _), recording = injected(2)
    end = start + 0.2e-3
    shut = misfired(recording, (0.0, recording.samples / SAMPLE_RATE))
    sent = [*samples(recording, (0.0, end)), *later(samples(shut), end)]
    energizing_frames = [*on_change([(0.1, lasts)]), on_change([(start, lasts)])[0]]
    watched = watch(pulse_bench(tmp_path, EnergizingBy.LEVEL), sent, energizing_frames)
    assert (watched.core.counters.restarts, watched.energized[1]) == (1, [1])
