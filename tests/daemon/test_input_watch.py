"""Which cable is off: faults cut into the frames of a healthy bench are named by message and identifier."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.daemon.input_watch import PERIOD, InputWatch, Trouble
from observer_rt.daemon.signal_watch import LiftWatch
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.standstill import LiftFigures
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.units import NANOSECONDS, Floats
from tests.benches import SAMPLE_RATE, block_bench
from tests.device import damaged, frames_of, later, worn_recording

LIFT = "NeedleLiftBlock 0x111 (needle_lift)"
RAIL = "RailPressureBlock 0x110 (rail_pressure)"
LINE = "LinePressureBlock 0x112 (line_pressure)"
Values = Floats
LIFT_ID = 0x111


class WatchedInputs:
    def __init__(self, bench: Path) -> None:
        self.bench, self.recording = bench, worn_recording(80, 0.0)
        self.frames = frames_of(bench, self.recording)

    def tells(self, frames: Sequence[TimedFrame], silence: float = 0.0) -> list[str]:
        """What the watch says of frames, by their times, and of a silence [s] after them, in which it looks, too."""
        loaded = load_bench(self.bench)
        bus = map_bus(loaded)
        core = Core(loaded.injector, bus, learning=False)
        watch = InputWatch(loaded.injector, bus, core)
        due = frames[0].stamp_ns
        watch.arrivals.begin(due)
        notices: list[Notice] = []
        for frame in frames:
            while due < frame.stamp_ns - PERIOD:
                due += PERIOD
                notices += watch.look(due)
            core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns)
            watch.arrivals.note(0, frame.frame_id, frame.is_extended, frame.stamp_ns)
            if frame.stamp_ns >= due:
                due = frame.stamp_ns + PERIOD
                notices += watch.look(frame.stamp_ns)
        for late in np.arange(0.0, silence, PERIOD / NANOSECONDS):
            notices += watch.look(frames[-1].stamp_ns + round(late * NANOSECONDS))
        self.is_lift_missing = watch.is_lift_missing
        return [notice.text for notice in notices]

    def tells_of(self, role: str, law: Callable[[Values], Values]) -> list[str]:
        spoilt = replace(self.recording, **{role: law(getattr(self.recording, role))})  # type: ignore[arg-type]
        return self.tells(frames_of(self.bench, spoilt))


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> WatchedInputs:
    return WatchedInputs(block_bench(tmp_path_factory.mktemp("watch"), "virtual", ["watch"]))


def frozen(values: Values) -> Values:
    return np.full_like(values, values[0])


def late(value: float) -> Callable[[Values], Values]:
    return lambda values: np.where(np.arange(len(values)) > 60_000, value, values)


def test_of_a_healthy_bench_nothing_is_told(watched: WatchedInputs) -> None:
    assert watched.tells(later(watched.frames, 100.0), silence=1.9) == []


def test_of_windows_filled_up_nothing_is_told(watched: WatchedInputs) -> None:
    """Frames come for 10 ms of every 100 ms only, as from a source that sends windows."""
    assert watched.tells([frame for frame in watched.frames if frame.stamp_ns % 100_000_000 < 10_000_000]) == []


def test_a_message_that_never_comes_or_with_an_identifier_of_the_other_size(watched: WatchedInputs) -> None:
    without = [frame for frame in watched.frames if frame.frame_id != LIFT_ID]
    assert watched.tells(without) == [f"{LIFT}: {Trouble.SILENT.begun}"]
    extended = [frame._replace(is_extended=frame.frame_id == LIFT_ID) for frame in watched.frames]
    assert watched.tells(extended) == [f"{LIFT}: {Trouble.OTHER_SIZE.begun}"]


def test_a_message_that_stays_away_for_a_while(watched: WatchedInputs) -> None:
    frames = [each for each in watched.frames if each.frame_id != LIFT_ID or not 1e9 < each.stamp_ns < 3.5e9]
    assert watched.tells(frames) == [f"{LIFT}: {text}" for text in (Trouble.SILENT.begun, Trouble.SILENT.over)]


def test_all_stay_away(watched: WatchedInputs) -> None:
    (notice,) = watched.tells(watched.frames, silence=10.0)
    assert notice.startswith(f"no frame of any input for 2 s: {RAIL}, {LIFT}, {LINE}\n")


def test_one_that_stays_away_when_the_others_come_again(watched: WatchedInputs) -> None:
    """All were silent; that one still is, is news."""
    before = [frame for frame in watched.frames if frame.stamp_ns < 1e9]
    after = later((f for f in watched.frames if f.stamp_ns >= 1e9 and f.frame_id != LIFT_ID), 3.0)
    notices = watched.tells([*before, *after])
    assert notices[0].startswith("no frame of any input for 2 s")
    assert notices[1:] == ["inputs come again", f"{LIFT}: {Trouble.SILENT.begun}"]


def test_frames_that_cannot_be_used(watched: WatchedInputs) -> None:
    """The CRC of one message is wrong, as with another E2EDataId."""
    spoilt = [f._replace(payload=b"\0\0" + f.payload[2:]) if f.frame_id == LIFT_ID else f for f in watched.frames]
    count, notice = watched.tells(spoilt)
    assert "input frames: frames whose end-to-end protection is wrong\n" in count
    assert notice == f"{LIFT}: {Trouble.USELESS.begun}"


def test_frames_of_another_length_are_named_with_both_lengths(watched: WatchedInputs) -> None:
    short = [f._replace(payload=f.payload[:24]) if f.frame_id == LIFT_ID else f for f in watched.frames]
    notices = watched.tells(short)
    length = next(len(frame.payload) for frame in watched.frames if frame.frame_id == LIFT_ID)
    named = f"NeedleLiftBlock 0x111 with 24 bytes for {length}\n  remedy: correct the database"
    assert f"input frames: frames of another length than the database says: {named}" in notices[0]
    assert notices[1] == f"{LIFT}: {Trouble.USELESS.begun}"


@pytest.mark.parametrize(
    ("role", "name", "fault", "said"),
    [
        ("rail_pressure", RAIL, frozen, "is frozen: the same value"),
        ("needle_lift", LIFT, frozen, "is frozen: the same value"),
        ("line_pressure", LINE, frozen, "is frozen: the same value"),
        ("needle_lift", LIFT, late(np.nan), "says `not available` or `error`"),
        ("line_pressure", LINE, late(1e9), "is at the upper end of its range"),
    ],
)
def test_a_bad_sensor(
    watched: WatchedInputs, role: str, name: str, fault: Callable[[Values], Values], said: str
) -> None:
    (notice,) = watched.tells_of(role, fault)
    assert notice.startswith(f"{name}: {role} {said}")
    assert watched.is_lift_missing is said.startswith("says")


def test_a_sensor_that_is_mended(watched: WatchedInputs) -> None:
    def for_a_second(values: Values) -> Values:
        return np.where((np.arange(len(values)) // round(SAMPLE_RATE)) == 1, values[0], values)

    notices = watched.tells_of("line_pressure", for_a_second)
    assert (len(notices), notices[1]) == (2, f"{LINE}: line_pressure is well again")


def test_a_lift_that_is_cut_off_at_rest_is_not_called_frozen(watched: WatchedInputs) -> None:
    """Its noise does not show while the needle is shut, and the line still swings then."""
    assert watched.tells_of("needle_lift", lambda lift: np.where(lift < 20e-6, 0.0, lift)) == []


@pytest.mark.parametrize(
    ("unit", "problem", "likely"),
    [
        ("10 MPa", "reaches 1", "which is likely bar"),
        ("bar", "rail_pressure 120 MPa: 0.1 times as much", "line_pressure is likely MPa, if read as bar"),
    ],
)
def test_a_pressure_in_another_unit_is_named_as_it_is_in_files(
    watched: WatchedInputs, tmp_path: Path, unit: str, problem: str, likely: str
) -> None:
    wrong = block_bench(tmp_path, "virtual", ["watch"])
    pattern = 'pattern = "LinePressure_{:02d}"'
    wrong.write_text(wrong.read_text().replace(pattern, f'{pattern}\nunit = "{unit}"'))
    (named,) = (text for text in WatchedInputs(wrong).tells(watched.frames) if likely in text)
    assert named.startswith(f"{LINE}: line_pressure ")
    assert problem in named


@pytest.mark.parametrize("most", [90, 40])
def test_values_outside_the_declared_range_are_named_once(watched: WatchedInputs, tmp_path: Path, most: int) -> None:
    """Half of them or all, of 60 and 120 MPa; the code for `not available`, which follows, does not count."""
    narrow = block_bench(tmp_path, "virtual", ["watch"])
    database = resources.files("observer_rt.data").joinpath("observer_fd.dbc").read_text()
    ranges = re.sub(r"( SG_ RailPressure_.*) \[-10\|317.665\]", rf"\1 [-10|{most}]", database)
    (tmp_path / "observer_fd.dbc").write_text(ranges)
    rail = np.where(np.arange(watched.recording.samples) > 150_000, np.nan, watched.recording.rail_pressure)
    frames = frames_of(watched.bench, replace(watched.recording, rail_pressure=rail))
    (notice,) = (text for text in WatchedInputs(narrow).tells(frames) if f"outside [-10|{most}]" in text)
    count = int(notice.removeprefix("rail_pressure: ").split()[0])
    assert 0 < count <= np.count_nonzero(rail > 1e6 * most)
    assert "of RailPressure_{:02d} in RailPressureBlock taken as missing, of " in notice
    assert "; the other pressure goes as far, so that range is wrong\n  remedy: correct the range in" in notice


def test_an_input_with_an_invalid_protection_is_named_until_it_is_valid_again(watched: WatchedInputs) -> None:
    of_lift = [n for n, frame in enumerate(watched.frames) if frame.frame_id == LIFT_ID]
    frames = list(watched.frames)
    for n in of_lift[1000:6000]:
        frames[n] = damaged(frames[n], 40)
    assert watched.tells(frames) == [f"{LIFT}: {text}" for text in (Trouble.INVALID.begun, Trouble.INVALID.over)]


FINE = LiftFigures(at_stop=0.3e-3, stop=0.3e-3)


def test_scale_is_told_once() -> None:
    watch = LiftWatch()
    assert not [*watch.look(LiftFigures())]
    short = LiftFigures(at_stop=0.27e-3, stop=0.3e-3)
    (notice,) = watch.look(short)
    assert "270 um" in notice.text
    assert "seat.max_lift = 300 um" in notice.text
    assert not notice.is_over
    assert not [*watch.look(short)]
    assert [one.is_over for one in watch.look(FINE)] == [True]
