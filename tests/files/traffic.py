"""Traffic of a bus with observers at work: the frames of devices, and the results of a core for each injector."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.core import Core, status_parts
from observer_rt.engine.service.messages import FrameWriter, OutputFrame
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.candump import CandumpWriter
from observer_rt.files.replay.framing import TimedFrame

BEGIN = 1_780_000_000_000_000_000  # ns since 1970
STATUS_EVERY = 100_000_000  # ns


class ObservedInjector:
    """A core beside the devices; `reports` are its injections."""

    def __init__(self, alone: Bench) -> None:
        self._bus = map_bus(alone)
        self._outputs = alone.injector.config.outputs
        self.reports: list[InjectionReport] = []
        self._core = Core(alone.injector, self._bus, listeners=(self._hear,))
        self._status = FrameWriter(self._bus.results_of(per_injection=False))
        self._due = 0

    def results(self, frame: TimedFrame) -> list[OutputFrame]:
        """What it sends upon a frame."""
        sent = self._core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)
        if frame.stamp_ns >= self._due:
            self._due = frame.stamp_ns + STATUS_EVERY
            state, reason = self._core.state
            others = {"injector_id": self._outputs.injector_id}
            sent = sent + self._status.write(status_parts(self._core, state, reason, others))
        return sent

    def _hear(self, news: News) -> None:
        if isinstance(news, InjectionReport):
            self.reports.append(news)


def traffic(frames: Sequence[TimedFrame], observers: Sequence[ObservedInjector]) -> Iterator[BusFrame]:
    """All frames in order, results some 10 us after what caused them."""
    for frame in frames:
        stamp = BEGIN + frame.stamp_ns
        yield BusFrame(
            frame.bus,
            Frame(frame.frame_id, frame.payload, stamp, frame.is_extended, frame.is_fd, frame.is_fd),
        )
        for observer in observers:
            for sent in observer.results(frame):
                stamp += 10_000
                payload = sent.payload
                yield BusFrame(
                    sent.bus, Frame(sent.frame_id, payload, stamp, sent.is_extended, sent.is_fd, sent.is_fd)
                )


def write_log(path: Path, came: Sequence[BusFrame], channels: Sequence[str]) -> None:
    """The frames as a log of candump."""
    with CandumpWriter(path, BEGIN) as writer:
        for frame in sorted(came, key=lambda one: one.frame.stamp_ns):
            writer.write(LogFrame(frame.frame, channels[frame.bus]))
