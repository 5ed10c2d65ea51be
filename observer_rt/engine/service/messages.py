"""Result frames: values into payloads, with the service's counts."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.output_messages import OutputMessage
from observer_rt.bus.mapping.output_signals import StatusValues, rows_of
from observer_rt.core.frames.frames import encode_signals, protect_frame
from observer_rt.engine.estimation.scalars import OFFSET
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.pipeline import Publisher
from observer_rt.foundation.units import Z_95


class OutputFrame(NamedTuple):
    """A frame to be sent."""

    frame_id: int
    is_extended: bool
    is_fd: bool
    payload: bytes
    bus: int = 0
    """Number of the bus it goes out on."""


def output_frame(layout: MessageLayout, payload: bytes) -> OutputFrame:
    """A frame of a message."""
    return OutputFrame(layout.frame_id, layout.is_extended, layout.is_fd, payload, layout.bus)


class FrameWriter:
    """Writes messages that are sent together; counts for the end-to-end protection of each."""

    def __init__(self, messages: Iterable[tuple[Any, OutputMessage]]) -> None:
        """messages: the table of the values, as `SummaryValues`, with each."""
        self._messages = [(rows_of(values).values(), message, count()) for values, message in messages]

    def write(self, parts: Mapping[str, Any]) -> list[OutputFrame]:
        """A frame for every page of each message; parts: where `value_of` finds the values."""
        frames = []
        for rows, message, counter in self._messages:
            layout = message.layout
            in_order = np.array([row.sent(value_of(row.source, parts)) for row in rows], np.float64)
            for page in message.pages:
                payload = page.blank.copy()
                encode_signals(in_order[page.places], page.table, payload)
                protect_frame(payload, layout.length, layout.protection, next(counter))
                frames.append(output_frame(layout, payload.tobytes()))
        return frames


class ResultFrames:
    """Collects frames with rates and summaries in the order they are made."""

    def __init__(self, bus: BusMap, publisher: Publisher, injector_id: int) -> None:
        self._rate_layout = bus.rate.layout if bus.rate else None
        self._publisher = publisher
        self._ready = publisher.memory["frames"]
        self._writer = FrameWriter(bus.results_of(per_injection=True))
        self._injector_id = injector_id
        self._frames: list[OutputFrame] = []

    def collect_results(self) -> None:
        """The frames that the publisher has ready."""
        if self._rate_layout is None or self._ready[0] == 0:
            return
        for frame in self._publisher.out[: int(self._ready[0])]:
            payload = frame["payload"][: int(frame["length"])].tobytes()
            self._frames.append(output_frame(self._rate_layout, payload))
        self._ready[0] = 0

    def add_summary(self, report: InjectionReport, learning: bool, pressure_scale: float) -> None:
        """Write the summary of an injection; pressure_scale p_0 [Pa]."""
        parts = {
            "report": report,
            "learning": learning,
            "injector_id": self._injector_id,
            "mass_sigma": report.mass_bound / Z_95,
            "line_pressure_offset": report.indicators[OFFSET].value * pressure_scale,
        }
        self._frames += self._writer.write(parts)

    def taken(self) -> list[OutputFrame]:
        """All frames since the last call, but for rates that nobody has collected."""
        frames, self._frames = self._frames, []
        return frames


def value_of(source: str, parts: Mapping[str, Any]) -> Any:
    """Value that a source names: a part, and a column, key or attribute of it; None where there is no such part.

    Of a column of several records the sum.
    """
    value: Any = parts
    for name in source.split("."):
        if isinstance(value, Mapping):
            value = value.get(name)
        elif isinstance(value, np.ndarray):
            value = value[name].sum()
        elif isinstance(value, np.void):
            value = value[name]
        elif value is not None:
            value = getattr(value, name)
    return value.item() if isinstance(value, np.number) else value


@dataclass(frozen=True)
class Counters:
    """Counts since the start; with the source of what the status does not send."""

    samples: Annotated[int, "observer.positions.processed"]
    lost_samples: int
    interpolated_samples: int
    spikes: int
    bridged_samples: int
    frames: Annotated[int, "receiver.frames"]
    crc_errors: int
    length_errors: int
    sequence_errors: int
    refused_frames: int
    repeated_frames: int
    old_frames: int
    restarts: int
    jumps: Annotated[int, "alignment.jumps"]
    events: Annotated[int, "observer.judgement.events_judged"]
    injections: Annotated[int, "observer.counts.injections_reported"]
    adoptions: int
    rejected_adoptions: int
    late_adoptions: int
    passed_over: Annotated[int, "judging.passed_over"]
    """Events judged, and not learned from since more came than can be."""
    commands: Annotated[int, "energizing.commands"]
    """Energizings of the injector; 0, as the next, where that is no input."""
    missing_injections: int
    uncommanded_injections: int

    @property
    def outliers(self) -> str:
        """Describes spikes and bridged values; empty: there were none."""
        if not self.spikes and not self.bridged_samples:
            return ""
        return f"{self.spikes} spikes replaced, {self.bridged_samples} values of frozen or missing inputs bridged"

    def since(self, earlier: "Counters") -> "Counters":
        """Counts since an earlier look."""
        return Counters(**{name: now - getattr(earlier, name) for name, now in vars(self).items()})


_SOURCES = {
    name: hint.__metadata__[0] if hasattr(hint, "__metadata__") else rows_of(StatusValues)[name].source
    for name, hint in get_type_hints(Counters, include_extras=True).items()
}


def counted(parts: Mapping[str, Any]) -> Counters:
    """Counts of all parts."""
    return Counters(**{name: value_of(source, parts) or 0 for name, source in _SOURCES.items()})
