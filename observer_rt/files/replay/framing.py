"""Frames of a recording, as a measuring device would send them by the bench's bus map; clamping is reported."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import BusMap, timing_row
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.role_range import message_of, role_range, role_resolution
from observer_rt.config.bench import EXAMPLE_BENCH, Bench
from observer_rt.config.injector_sections import HIGHEST_RATE, LOWEST_RATE
from observer_rt.core.frames.frames import Numbering, frames_of_message
from observer_rt.engine.signal_survey import Survey
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import Sampled
from observer_rt.files.signals.table_writers import PRINTED
from observer_rt.files.signals.time_axis import refuse_wrong_clock
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROMETRE, MILLISECOND, Floats, Ints
from observer_rt.model.surroundings import Surroundings

WINDOW_BEFORE = 2 * MILLISECOND  # of standstill before an injection, in which x~ becomes good
WINDOW_AFTER = 4 * MILLISECOND  # after it, in which the line rings
RATE_TOLERANCE = 1e-6  # relative, between recording and bench
OPEN_LIFT = 5 * MICROMETRE  # above any noise of the lift

_SHOWN_UNIT = {column.channel: (column.unit, column.factor) for column in PRINTED}


def bench_for(bench: Bench, recording: Sampled) -> Bench:
    """The bench at the recording's sample rate, for samples of the recording's meaning.

    The example bench takes any rate unless it is nearly the model's; a user's own must state the recording's,
    `[recording] rate_hz` before that of `[sampling]`. Raises `UserError` otherwise.
    """
    rate = recording.sample_rate
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        problem = f"is sampled at {rate:g} Hz, the observer takes {LOWEST_RATE:g} to {HIGHEST_RATE:g} Hz"
        remedy = "check the unit of the time, which is likely " + ("ms" if rate < LOWEST_RATE else "not s")
        raise UserError(str(recording.path), problem, remedy)
    replaced = [name for name in Surroundings._fields if name in recording.recorded]  # no frame carries them
    replaced += [] if recording.has_lift else ["needle_lift"]
    if replaced:
        bench = bench.with_sections(signals=bench.injector.config.signals.model_copy(update=dict.fromkeys(replaced)))
    sampling = bench.injector.config.sampling
    if recording.meaning not in (None, sampling.meaning):
        sampling = sampling.model_copy(update={"meaning": recording.meaning})
        bench = bench.with_sections(sampling=sampling)
    stated = sampling.rate_hz
    if abs(rate - stated) <= RATE_TOLERANCE * stated:
        return bench
    layout = bench.injector.config.recording
    if bench.path != EXAMPLE_BENCH and (layout is None or layout.rate_hz is None):
        problem = f"is {stated:g} Hz, but {recording.path} is sampled at {rate:g} Hz"
        remedy = "set rate_hz to the recording's rate, or leave out --bench"
        raise UserError(bench.injector.location("sampling.rate_hz"), problem, remedy)
    baseline = bench.injector.parameters.baseline
    if bench.path == EXAMPLE_BENCH and baseline is not None:
        refuse_wrong_clock(recording.path, rate, baseline.sample_rate_Hz, "the model was fitted at")
    return bench.with_sections(sampling=sampling.model_copy(update={"rate_hz": rate}))


class TimedFrame(NamedTuple):
    """A frame and when it is sent, in seconds after the recording's first sample."""

    time: float
    frame_id: int
    is_extended: bool
    is_fd: bool
    payload: bytes
    bit_rate_switch: bool = True
    """Flag of a CAN FD frame, as the next one is."""
    error_state_indicator: bool = False
    bus: int = 0
    """Number of the bench's bus it is sent on."""

    @property
    def stamp_ns(self) -> int:
        """Time of reception by a receiver without delay, in whole nanoseconds."""
        return round(self.time * 1e9)


class Span(NamedTuple):
    """Samples [start, end) of a recording."""

    start: int
    end: int


def all_samples(recording: Recording) -> list[Span]:
    return [Span(0, recording.samples)]


def windows_of(parts: Iterable[Recording]) -> list[Span]:
    """Spans round the injections of consecutive parts, as a windowed source sends them; those that touch are one."""
    spans: list[Span] = []
    samples = 0
    for part in parts:
        before, after = round(WINDOW_BEFORE * part.sample_rate), round(WINDOW_AFTER * part.sample_rate)
        edges = np.flatnonzero(np.diff(part.needle_lift > OPEN_LIFT, prepend=False, append=False)) + samples
        for first, shut in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            start, end = max(0, first - before), shut - 1 + after
            if spans and start <= spans[-1].end:
                start = spans.pop().start
            spans.append(Span(start, end))
        samples += part.samples
    return [Span(span.start, min(span.end, samples)) for span in spans]


def grid_samples(bus: BusMap, number: int) -> int:
    """Samples of the grid from one sample index of an input message to its next."""
    return int(bus.inputs.messages[number]["samples"]) * int(timing_row(bus, number)["steps"])


def block_samples(bus: BusMap) -> int:
    """Number of samples that fill frames of every input message."""
    return math.lcm(*(grid_samples(bus, number) for number in range(len(bus.input_layouts))))


class Framer:
    """Turns recordings into frames; its counters and sample index go on from one recording to the next."""

    def __init__(self, bus: BusMap) -> None:
        self._bus = bus
        self._counters = [0] * len(bus.input_layouts)
        self.next_index = 0
        """Sample index of the next recording's first sample."""

    def pause(self, samples: int) -> None:
        """Let the index go on by at least so many samples, to where a frame of every message begins anew."""
        before = self.next_index
        block = block_samples(self._bus)
        self.next_index = -(-(before + samples) // block) * block
        for number in range(len(self._counters)):
            if timing_row(self._bus, number)["numbering"] != Numbering.INDEX:  # Their counters go on with time.
                passed = (self.next_index - before) // grid_samples(self._bus, number)
                self._counters[number] += passed

    def frames(self, recording: Recording, spans: Sequence[Span]) -> Iterator[TimedFrame]:
        """Frames of the spans in order of time, each sent with its last sample; rest of a frame: "not available"."""
        interval = 1.0 / recording.sample_rate
        for framed in self.framed(recording, spans):
            due = (framed.due * interval).tolist()
            for number, time, payload in zip(framed.numbers.tolist(), due, framed.payloads(), strict=True):
                layout = self._bus.input_layouts[number]
                yield TimedFrame(time, layout.frame_id, layout.is_extended, layout.is_fd, payload, bus=layout.bus)

    def framed(self, recording: Recording, spans: Sequence[Span]) -> Iterator["FramedRecording"]:
        """Frames of some spans in arrays, span by span."""
        values = np.column_stack([getattr(recording, role.value) for role in ROLES])
        for span in spans:
            yield _merged([self._encode(number, values, span) for number in range(len(self._counters))])
        self.next_index += recording.samples

    def _encode(self, number: int, values: Floats, span: Span) -> "FramedRecording":
        message, inputs = self._bus.inputs.messages[number], self._bus.inputs
        steps = int(timing_row(self._bus, number)["steps"])
        first_index = -(-(self.next_index + span.start) // steps)  # of its own samples
        first = first_index * steps - self.next_index
        sampled = np.ascontiguousarray(values[first : span.end : steps])
        blocks = -(-len(sampled) // int(message["samples"])) * int(message["kind_count"])
        payloads = np.empty((blocks, int(message["length"])), np.uint8)
        frames_of_message(sampled, first_index, inputs, number, self._counters[number], payloads, np.empty(blocks))
        count, length = payloads.shape
        self._counters[number] += count
        block, kind = np.divmod(np.arange(count), int(message["kind_count"]))
        end = inputs.kinds["end"][int(message["first_kind"]) + kind]
        return FramedRecording(
            np.full(count, number),
            first + (block * int(message["samples"]) + end - 1) * steps,
            np.arange(count + 1) * length,
            payloads.ravel(),
        )


class FramedRecording(NamedTuple):
    """Frames in order (n of them): numbers (n,) of their input messages; due (n,), the sample each is sent with.

    starts (n + 1,): where each begins in `data`, and where the last one ends.
    """

    numbers: Ints
    due: Ints
    starts: Ints
    data: NDArray[np.uint8]

    def payloads(self) -> Iterator[bytes]:
        data = self.data.tobytes()
        return (data[first:end] for first, end in pairwise(self.starts.tolist()))


def _merged(messages: Sequence[FramedRecording]) -> FramedRecording:
    """Frames of several messages in the order of the samples they are sent with; each message keeps its order."""
    if len(messages) == 1:
        return messages[0]
    numbers = np.concatenate([message.numbers for message in messages])
    due = np.concatenate([message.due for message in messages])
    order = np.lexsort((numbers, np.concatenate([np.maximum.accumulate(message.due) for message in messages])))
    lengths = np.concatenate([np.diff(message.starts) for message in messages])
    starts = np.concatenate(([0], np.cumsum(lengths[order])))
    data = np.empty(int(starts[-1]), np.uint8)
    for number, message in enumerate(messages):
        if not message.numbers.size:
            continue
        payloads = message.data.reshape(len(message.numbers), -1)
        begins = starts[:-1][numbers[order] == number]
        data[begins[:, None] + np.arange(payloads.shape[1])] = payloads
    return FramedRecording(numbers[order], due[order], starts, data)


def clamped_in(survey: Survey, bus: BusMap) -> list[str]:
    """Lines for the roles with values that the bus cannot hold, which are clamped when sent."""
    warnings = []
    for role in (known for known in ROLES if known.value in survey.signals):
        extremes, limits = survey.signals[role.value], role_range(bus, role)
        unit, factor = _SHOWN_UNIT[role]
        for reached, limit, is_beyond in (
            (extremes.lowest, limits.lowest, limits.lowest - extremes.lowest),
            (extremes.highest, limits.highest, extremes.highest - limits.highest),
        ):
            if is_beyond > 0.5 * role_resolution(bus, role, limit):
                name = bus.input_layouts[message_of(bus, role)].name
                warnings.append(
                    f"{role}: reaches {reached / factor:.6g} {unit}, beyond {limit / factor:.6g} {unit}, the limit "
                    f"of {name}, and is clamped to it"
                )
    return warnings
