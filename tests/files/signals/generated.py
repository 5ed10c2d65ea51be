"""A recording that nobody holds: its samples are made as they are read."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from observer_rt.files.signals.recording import OPTIONAL, Chunk, Recording
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, SignalStream, Stretch, cut


class RepeatedRecording(SignalStream):
    """A recording again and again without a pause; several numbers: as many stretches, a second between them."""

    def __init__(self, recording: Recording, *times: int) -> None:
        super().__init__(Path("repeated.csv"))
        self._recording, self._times = recording, times
        self.sample_rate = recording.sample_rate
        self.optional = tuple(name for name in OPTIONAL if name in recording.signals)
        start, stretches = 0.0, []
        for number in times:
            stretches.append(Stretch(start, number * recording.samples))
            start += stretches[-1].samples / self.sample_rate + 1.0
        self.stretches = tuple(stretches)

    def chunks(self) -> Iterator[Chunk]:
        recording = self._recording
        for number, (times, stretch) in enumerate(zip(self._times, self.stretches, strict=True)):
            for again in range(times):
                first = again * recording.samples
                time = stretch.start + (first + np.arange(recording.samples)) / self.sample_rate
                signals = recording.rail_pressure, recording.needle_lift, recording.line_pressure
                complete = Chunk(time, *signals, recording.injection_rate, self.path, self.sample_rate, number)
                for position in range(0, recording.samples, SAMPLES_AT_ONCE):
                    part = cut(complete, position, min(recording.samples, position + SAMPLES_AT_ONCE))
                    yield replace(part, first=first + position)
