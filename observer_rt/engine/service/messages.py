"""Result frames: values into payloads, with what the service counts."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.output_messages import OutputMessage, StatusValues, SummaryValues
from observer_rt.core.frames.frames import encode_signals, protect_frame
from observer_rt.engine.estimation.scalars import NOZZLE, OFFSET, SEAT
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.energizing import EnergizingFigures
from observer_rt.engine.service.judging import Judging
from observer_rt.engine.service.pipeline import Pipeline
from observer_rt.engine.service.publisher import Publisher
from observer_rt.foundation.units import CUBIC_MILLIMETRE, MEGAPASCAL, MILLIGRAM, MM3_PER_MS


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
    """Writes frames of one message; counts for the end-to-end protection."""

    def __init__(self, message: OutputMessage) -> None:
        self._message = message
        self._counter = 0

    def write(self, values: SummaryValues | StatusValues) -> list[OutputFrame]:
        """A frame for every page; nan is not available."""
        in_order = np.array(values, np.float64)
        layout = self._message.layout
        frames = []
        for page in self._message.pages:
            payload = page.blank.copy()
            encode_signals(in_order[page.places], page.table, payload)
            protect_frame(payload, layout.length, layout.protection, self._counter)
            self._counter += 1
            frames.append(output_frame(layout, payload.tobytes()))
        return frames


class ResultFrames:
    """Collects frames with rates and summaries in the order they are made."""

    def __init__(self, bus: BusMap, publisher: Publisher, injector_id: int) -> None:
        self._rate_layout = bus.rate.layout if bus.rate else None
        self._publisher = publisher
        self._ready = publisher.memory["frames"]
        self._summary_writer = FrameWriter(bus.summary)
        self._injector_id = injector_id
        self._frames: list[OutputFrame] = []

    def collect_rates(self) -> None:
        """The frames that the publisher has ready."""
        if self._rate_layout is None or self._ready[0] == 0:
            return
        for frame in self._publisher.out[: int(self._ready[0])]:
            payload = frame["payload"][: int(frame["length"])].tobytes()
            self._frames.append(output_frame(self._rate_layout, payload))
        self._ready[0] = 0

    def add_summary(self, report: InjectionReport, learning: bool, pressure_scale: float) -> None:
        """Write the summary of an injection; pressure_scale p_0 [Pa]."""
        values = summary_values(report, self._injector_id, learning, pressure_scale)
        self._frames += self._summary_writer.write(values)

    def taken(self) -> list[OutputFrame]:
        """All frames since the last call, but for rates that nobody has collected."""
        frames, self._frames = self._frames, []
        return frames


def summary_values(
    report: InjectionReport, injector_id: int, learning: bool, pressure_scale: float
) -> SummaryValues:
    """The summary of an injection; pressure_scale p_0 [Pa]."""
    nozzle, seat, offset = (report.indicators[name] for name in (NOZZLE, SEAT, OFFSET))
    mass_sigma = report.mass_bound / 1.96
    return SummaryValues(
        sample_index=report.start_index & 0xFFFFFFFF,
        valid=report.valid,
        learning=learning,
        state=report.state,
        end_index=report.end_index & 0xFFFFFFFF,
        injection_number=report.number & 0xFFFFFFFF,
        event_number=report.event & 0xFFFFFFFF,
        phi_version=report.phi_version & 0xFFFF,
        injector_id=injector_id,
        reason=report.reason,
        mass=report.mass / MILLIGRAM,
        mass_sigma=mass_sigma / MILLIGRAM,
        volume=report.volume / CUBIC_MILLIMETRE,
        rail_pressure_at_start=report.rail_pressure / MEGAPASCAL,
        peak_injection_rate=report.peak_rate / MM3_PER_MS,
        nozzle_wear=nozzle.value,
        nozzle_wear_sigma=np.nan if nozzle.sigma is None else nozzle.sigma,
        seat_wear=seat.value,
        seat_wear_sigma=np.nan if seat.sigma is None else seat.sigma,
        line_pressure_offset=offset.value * pressure_scale / MEGAPASCAL,
    )


@dataclass(frozen=True)
class Counters:
    """What was counted since the start."""

    samples: int
    lost_samples: int
    interpolated_samples: int
    spikes: int
    bridged_samples: int
    frames: int
    crc_errors: int
    length_errors: int
    sequence_errors: int
    refused_frames: int
    repeated_frames: int
    old_frames: int
    restarts: int
    jumps: int
    events: int
    injections: int
    adoptions: int
    rejected_adoptions: int
    late_adoptions: int
    passed_over: int
    """Events judged, and not learned from since more came than can be."""
    commands: int
    """Energizings of the injector; 0, as the next, where that is no input."""
    missing_injections: int
    uncommanded_injections: int

    @property
    def outliers(self) -> str:
        """Spikes and bridged values, in words; empty: there were none."""
        if not self.spikes and not self.bridged_samples:
            return ""
        return f"{self.spikes} spikes replaced, {self.bridged_samples} values of frozen or missing inputs bridged"

    def since(self, earlier: "Counters") -> "Counters":
        """What was counted since an earlier look."""
        return Counters(**{name: count - getattr(earlier, name) for name, count in vars(self).items()})


def counted(pipeline: Pipeline, energizing: EnergizingFigures | None, judging: Judging) -> Counters:
    """What all parts have counted."""
    receiver = pipeline.receiver[0]
    alignment = pipeline.alignment.memory[0]
    memory = pipeline.observer.memory[0]
    positions, outliers = memory["positions"], memory["outliers"]
    return Counters(
        samples=int(positions["processed"]),
        lost_samples=int(alignment["lost"]),
        interpolated_samples=int(positions["interpolated"]),
        spikes=int(outliers["spikes"]),
        bridged_samples=int(outliers["bridged"]),
        **{
            name: int(receiver[name]) for name in ("frames", "crc_errors", "length_errors", "sequence_errors")
        },
        refused_frames=int(pipeline.supervised["refused"].sum()),
        repeated_frames=int(alignment["repeated"]),
        old_frames=int(alignment["old"]),
        restarts=int(alignment["restarts"]),
        jumps=int(alignment["jumps"]),
        events=int(memory["judgement"]["events_judged"]),
        injections=int(memory["counts"]["injections_reported"]),
        adoptions=judging.adoptions,
        rejected_adoptions=judging.rejected,
        late_adoptions=judging.late,
        passed_over=judging.passed_over,
        commands=energizing.commands if energizing else 0,
        missing_injections=energizing.missing if energizing else 0,
        uncommanded_injections=energizing.uncommanded if energizing else 0,
    )
