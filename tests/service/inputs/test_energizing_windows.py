"""Commands and openings where the device's index begins anew, and where samples come in windows only."""

from collections.abc import Callable
from pathlib import Path

import pytest

from observer_rt.recording.replay.framing import TimedFrame
from tests.benches import SAMPLE_RATE
from tests.device import INDICES, later
from tests.service.pulse_bench import Told, pulse_bench
from tests.service.pulse_frames import (
    blocks,
    commands,
    durations,
    injected,
    misfired,
    on_change,
    safe_blocks,
    samples,
    watch,
)


@pytest.mark.parametrize("first", [0, (1 << 32) - 8000])
def test_index_of_a_device_that_restarts(tmp_path: Path, first: int) -> None:
    """It counts from 0 again after two injections, once from just below the end of the count."""
    schedule, recording = injected(2)
    pulses = commands(schedule)
    length = recording.samples / SAMPLE_RATE
    sent = samples(recording, index=first), later(samples(recording), length)
    told = on_change(pulses, first), later(on_change(pulses), length)
    watched = watch(pulse_bench(tmp_path, Told.LEVEL), *sent, *told)
    assert watched.commands == [1, 2, 3, 4]
    assert watched.notes.mismatches == []


def test_a_command_told_before_the_first_sample_of_a_device_that_restarts(tmp_path: Path) -> None:
    schedule, recording = injected(2)
    (start, _), *_ = commands(schedule)
    length = recording.samples / SAMPLE_RATE
    begun = start - 0.2e-3  # the device starts just before the first command
    again = samples(recording, (begun, length), index=-round(begun * SAMPLE_RATE) % INDICES)
    sent = samples(recording), later(again, length - begun)
    told_again = on_change([(time - begun, lasts) for time, lasts in commands(schedule)])
    told = on_change(commands(schedule)), later(told_again, length - 0.5e-3)
    watched = watch(pulse_bench(tmp_path, Told.LEVEL), *sent, *told)
    assert watched.commands == [1, 2, 3, 4]
    assert watched.notes.mismatches == []


def test_a_command_cut_off_by_a_restart_is_never_missing(tmp_path: Path) -> None:
    """Nor when the new count comes to where the old one ended, the needle shut."""
    schedule, recording = injected(2)
    (start, lasts), *_ = commands(schedule)
    end = start + 0.2e-3
    shut = misfired(recording, (0.0, recording.samples / SAMPLE_RATE))
    again = later(samples(shut), end)
    told = [*on_change([(0.1, lasts)]), on_change([(start, lasts)])[0]]
    watched = watch(pulse_bench(tmp_path, Told.LEVEL), samples(recording, (0.0, end)), again, told)
    assert watched.core.counters.restarts == 1
    assert watched.missing == [1]


def test_a_level_that_was_high_before_the_first_frame_misses_nothing(tmp_path: Path) -> None:
    """When energizing started is not known, nor whether it had an injection."""
    schedule, recording = injected(3)
    pulses = commands(schedule)
    start = pulses[1][0]
    told = blocks(pulses, start + 0.4e-3, 0.3)
    watched = watch(
        pulse_bench(tmp_path, Told.LEVELS_IN_BLOCK), samples(misfired(recording, (start, start + 5e-3))), told
    )
    assert watched.commands == [None, 1]
    assert watched.notes.mismatches == []


def test_a_window_that_ends_in_a_pause_is_seen(tmp_path: Path) -> None:
    """The needle is shut in a legal pause of a windowed source; so it is where one begins 2 ms after a command."""
    schedule, recording = injected(3)
    pulses = commands(schedule)
    spans = [(start - 1.5e-3, start + (2e-3 if n == 1 else 5e-3)) for n, (start, _) in enumerate(pulses)]
    watched = watch(
        pulse_bench(tmp_path, Told.LEVEL), samples(misfired(recording, spans[1]), *spans), on_change(pulses)
    )
    assert (watched.missing, watched.uncommanded) == ([2], [])


@pytest.mark.parametrize("lost", [False, True])
def test_protected_blocks_of_a_windowed_source_tell_a_pause_from_a_loss(tmp_path: Path, lost: bool) -> None:
    """In the pause before its window an injection had no command; not so if blocks were lost."""
    schedule, recording = injected(4)
    pulses = commands(schedule)
    spans = [(start - 1.5e-3, start + 5e-3) for start, _ in pulses]
    told = safe_blocks([*pulses[:2], pulses[3]], *spans)
    if lost:
        told = [one for one in told if not spans[2][0] <= one.time < spans[2][0] + 0.5e-3]
    watched = watch(pulse_bench(tmp_path, Told.SAFE_BLOCK), samples(recording, *spans), told)
    assert watched.commands == [1, 2, None, 3]
    assert watched.uncommanded == ([] if lost else [3])
    assert watched.missing == []


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("lines", [Told.LEVEL, Told.TIME_BY_STAMP, Told.LEVELS_IN_BLOCK])
def test_windowed_source(tmp_path: Path, lines: str, missing: bool) -> None:
    """Samples only round the injections; of four, the second may misfire and the third have no command."""
    schedule, recording = injected(4)
    pulses = commands(schedule)
    spans = [(start - 1.5e-3, start + 5e-3) for start, _ in pulses]
    if missing:
        recording = misfired(recording, spans[1])
        del pulses[2]
    sources: dict[str, Callable[[], list[TimedFrame]]] = {
        Told.LEVEL: lambda: on_change(pulses),
        Told.TIME_BY_STAMP: lambda: durations(pulses),
        Told.LEVELS_IN_BLOCK: lambda: [one for span in spans for one in blocks(pulses, *span)],
    }
    watched = watch(pulse_bench(tmp_path, lines), samples(recording, *spans), sources[lines]())
    if missing:
        assert watched.missing == [2]
        assert watched.uncommanded == ([] if lines == Told.LEVELS_IN_BLOCK else [2])
        assert watched.commands == [1, None, 3]
    else:
        assert watched.commands == [1, 2, 3, 4]
        assert watched.notes.mismatches == []
