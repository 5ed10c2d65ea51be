"""A CAN log as a recording: its frames through the daemon's own path, and what the observer was given of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.message_timing import MessageTiming
from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import UserError
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.recording.canlog.can_log import NANOSECONDS
from observer_rt.recording.channels import chosen_channels
from observer_rt.recording.input_frames import InputFrames
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.core.core import Core
from observer_rt.service.core.counters import Counters
from observer_rt.service.watch.log_watch import LogWatch

READ_EVERY = 64  # frames between two looks at the observer's memory, which forgets
RATE_TOLERANCE = 0.02  # of the sample rate by stamps, beyond which a log is odd
FEWEST_FOR_RATE = 100  # frames
LARGEST_SPAN = 1 << 28  # samples: 8 GiB in memory


@dataclass(frozen=True)
class LoggedRecording:
    """A log, decoded by a bench file.

    recording: what the observer was given, NaN where no sample came; it begins with sample index `first_index`.
    frames: the frames as they are in the log. notes: what the user should know of the log. counters, standstill,
    timing: of the observer that was given it.
    """

    recording: Recording
    first_index: int
    frames: InputFrames
    notes: tuple[str, ...]
    counters: Counters
    standstill: Standstill
    timing: tuple[MessageTiming, ...]


def read_logged(
    bench: Bench,
    path: Path,
    from_channels: Sequence[str] = (),
    progress: Callable[[float], None] = lambda _: None,
) -> LoggedRecording:
    """Decode a log; from_channels: texts of `--from-channel`; progress: share done, 0 to 1.

    Raises `UserError` for a log that is malformed, holds no input of the bench, or in which the sample index begins
    anew.
    """
    bus = map_bus(bench)
    needed = {layout.bus for layout in bus.input_layouts}
    channels = chosen_channels(path, bench.config.buses, needed, from_channels)
    frames = InputFrames(path, bus, channels)
    core = Core(bench.injector, bus, learning=False)
    pieces: list[NDArray[np.void]] = []
    seen = 0
    stamps = _Stamps()
    watch = LogWatch(bench.injector, bus, core)
    for count, (on, frame) in enumerate(frames):
        core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, on)
        watch.note(on, frame)
        if core.processed > 0:  # before, clocks may have to be learned
            stamps.note(frame)
        if count % READ_EVERY == 0:
            pieces.append(core.rows(seen, core.processed))
            seen = core.processed
            progress(frames.share_read)
    core.finish()
    rows = np.concatenate([*pieces, core.rows(seen, core.processed)])
    if len(rows) < 2:
        counted = core.counters
        absent = watch.absent()
        odd = "; ".join(absent) or f"{counted.crc_errors} CRC errors, {counted.length_errors} of wrong length"
        raise UserError(
            str(path),
            f"its {counted.frames} input frames give {len(rows)} samples: {odd}",
            "record all inputs: was the device on, its channel recorded?"
            if absent
            else "give --bench with the file the log was recorded by",
        )
    rate = bench.injector.config.sampling.rate_hz
    recording = _recording(bench, rows, path)
    notes = [
        *frames.notes(),
        *watch.notes(path),
        *stamps.notes(path, rate, int(rows["index"][-1] - rows["index"][0])),
    ]
    found = core.counters, core.standstill, core.timing
    return LoggedRecording(recording, int(rows["index"][0]), frames, tuple(notes), *found)


def _recording(bench: Bench, rows: NDArray[np.void], path: Path) -> Recording:
    index = rows["index"]
    back = np.flatnonzero(np.diff(index) <= 0)
    if back.size:
        raise UserError(
            str(path),
            f"the sample index begins anew after {index[back[0]]}: a device was restarted",
            "split the log there",
        )
    samples = int(index[-1] - index[0]) + 1
    if samples > LARGEST_SPAN:
        raise UserError(
            str(path),
            f"its sample index spans {samples} samples, {len(rows)} of them in the log",
            "split the log where the index jumps",
        )
    c = bench_constants(bench.injector).coefficients
    received = ~rows["interpolated"]
    place = (index - index[0])[received]

    def signal(values: NDArray[np.float64]) -> NDArray[np.float64]:
        placed = np.full(samples, np.nan)
        placed[place] = values[received]
        return placed

    def pressure(name: str) -> NDArray[np.float64]:
        return signal(rows[name] * c.pressure_scale + c.chamber_pressure)

    return Recording(
        time=np.arange(samples) / bench.injector.config.sampling.rate_hz,
        rail_pressure=pressure("rail_pressure"),
        needle_lift=signal(np.interp(index, index + rows["lift_after"], rows["needle_lift"])),
        line_pressure=pressure("line_pressure"),
        path=path,
    )


class _Stamps:
    """First and last stamp of the frames: with the sample index they tell the sample rate."""

    def __init__(self) -> None:
        self._frames = 0
        self._first = self._last = 0

    def note(self, frame: Frame) -> None:
        if not self._frames:
            self._first = frame.stamp_ns
        self._frames += 1
        self._last = frame.stamp_ns

    def notes(self, path: Path, rate: float, intervals: int) -> list[str]:
        """A warning where the stamps contradict the bench's sample rate [Hz]."""
        duration = (self._last - self._first) / NANOSECONDS
        if self._frames < FEWEST_FOR_RATE or duration <= 0.0:
            return []
        found = intervals / duration
        if abs(found / rate - 1.0) <= RATE_TOLERANCE:
            return []
        return [
            f"{path}: by its stamps {found:.4g} samples a second were sent, the bench file says {rate:g}: "
            "right if it was replayed at another speed, else correct sampling.rate_hz"
        ]
