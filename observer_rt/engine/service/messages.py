"""From received frames to those they cause: memory of the compiled path, result frames, the service's counts."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment import Alignment, Timekeeping
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import Inputs
from observer_rt.bus.mapping.output_messages import HEADER_SIGNALS, OutputMessage, OutputPage, RateMessage
from observer_rt.bus.mapping.output_signals import StatusValues, rows_of
from observer_rt.config.injector_sections import E2EConfig
from observer_rt.config.signals import OPTIONAL_SIGNALS, OptionalRole
from observer_rt.core.frames import frames as core
from observer_rt.engine.estimation.parameters import OFFSET
from observer_rt.engine.observer import INDICES, with_constants
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Constants, Observer
from observer_rt.foundation.units import MM3_PER_MS, Z_95, Floats, Structs
from observer_rt.model.surroundings import Surroundings


def make_receiver() -> Structs:
    """Receiver that has seen no frame."""
    receiver = np.zeros(1, core.RECEIVER)
    receiver["last_counter"] = receiver["odd_length"] = -1
    receiver["lowest"], receiver["highest"] = math.inf, -math.inf
    return receiver


def make_supervised(messages: Structs, limits: E2EConfig) -> Structs:
    """State machines of input messages that have seen no frame, (messages,) `SUPERVISION`."""
    supervised = np.zeros(len(messages), core.SUPERVISION)
    supervised["counter"] = -1
    supervised["window"] = limits.window
    supervised["min_ok"] = [0, limits.init_min_ok, limits.valid_min_ok, limits.invalid_min_ok]
    supervised["max_errors"] = [0, limits.init_max_errors, limits.valid_max_errors, limits.invalid_max_errors]
    return supervised


class InputMemory(NamedTuple):
    """Optional inputs as received; those whose order counts wait in a ring for Python."""

    memory: Structs  # (1,)
    newest: Structs  # (optional inputs,)
    readings: Structs  # (READINGS,)
    values: Floats  # (READINGS, most signals of an input) SI


def make_input_memory(inputs: Inputs, may_learn: bool, assumed: Surroundings) -> InputMemory:
    """Memory of no inputs yet; assumed: until they are measured. Nothing is valid without those that are inputs."""
    memory, newest = np.zeros(1, core.OPTIONAL), np.zeros(len(inputs.optional), core.OPTIONAL_VALUE)
    memory["newest"] = -1
    memory["may_learn"] = memory["learning"] = may_learn
    memory["measured"] = math.nan
    memory["is_input"][0][[row for row in inputs.optional["surrounding"] if row >= 0]] = True
    memory["in_force"] = np.array(assumed, np.float64)  # nan of None
    memory["is_assumed"] = ~np.isnan(memory["in_force"])
    memory["steps"] = [OPTIONAL_SIGNALS[OptionalRole(name)].step for name in Surroundings._fields]
    memory["since_change"] = math.inf
    newest["follows"] = True
    return InputMemory(
        memory,
        newest,
        np.zeros(core.READINGS, core.READING),
        np.zeros((core.READINGS, int(inputs.optional["signal_count"].max(initial=0)))),
    )


class Publisher(NamedTuple):
    """Publisher of the observer's samples: every index once, in blocks that carry it."""

    memory: Structs  # (1,) PUBLISHER
    table: Structs  # SIGNAL
    values: Floats  # to encode, the block's rates last
    out: Structs  # (FRAMES,) OUT_FRAME, of which `memory[0].frames` are for the caller


def make_publisher(message: RateMessage | None, learning: bool) -> Publisher:
    """Publisher of blocks of rates in `message`; None: of nothing."""
    memory, out = np.zeros(1, core.PUBLISHER), np.zeros(core.FRAMES, core.OUT_FRAME)
    if message is None:
        return Publisher(memory, np.zeros(0, core.SIGNAL), np.zeros(0), out)
    names = message.page.names
    memory["learning"] = learning
    memory["header"] = tuple(names.index(name) if name in names else -1 for name in HEADER_SIGNALS)
    memory["samples"] = message.samples
    memory["length"] = message.layout.length
    memory["protection"] = message.layout.protection
    return Publisher(memory, message.page.table, np.full(len(names), np.nan), out)


class Pipeline(NamedTuple):
    """All memory of the receive-to-send path."""

    inputs: Inputs
    receiver: Structs  # (1,) RECEIVER
    supervised: Structs  # (messages,) SUPERVISION
    input_memory: InputMemory
    keeping: Timekeeping
    alignment: Alignment
    observer: Observer
    publisher: Publisher


class CompiledPipeline(core.FramePath):
    """The one owner of a pipeline; the observer's constants are replaced here only."""

    def __init__(self, pipeline: Pipeline) -> None:
        super().__init__(pipeline)
        self.pipeline = pipeline
        """Memory that compiled code works on."""

    @property
    def observer(self) -> Observer:
        """The pipeline's observer now; another one after the constants change."""
        return self.pipeline.observer

    def change_constants(self, constants: Constants) -> None:
        """Observe with other constants from here on; not while compiled code is at work with it."""
        if self.observer.constants.coefficients.valve.commanded:
            constants = constants.by_commands()
        self.pipeline = self.pipeline._replace(observer=with_constants(self.observer, constants))


class OutputFrame(NamedTuple):
    frame_id: int
    is_extended: bool
    is_fd: bool
    payload: bytes
    bus: int = 0
    """Number of the bus it goes out on."""


def output_frame(layout: MessageLayout, payload: bytes) -> OutputFrame:
    return OutputFrame(layout.frame_id, layout.is_extended, layout.is_fd, payload, layout.bus)


class FrameWriter:
    """Writes messages that are sent together; counts for the end-to-end protection of each."""

    def __init__(self, messages: Iterable[tuple[Any, OutputMessage]]) -> None:
        """messages: the table of the values, as `SummaryValues`, with each."""
        self._messages = [(rows_of(values).values(), message, count()) for values, message in messages]

    def write(self, parts: Mapping[str, Any]) -> list[OutputFrame]:
        """A frame for every page of each message; parts: where `value_of` finds the values."""
        frames: list[OutputFrame] = []
        for rows, message, counter in self._messages:
            in_order = np.array([row.sent(value_of(row.source, parts)) for row in rows], np.float64)
            frames += [_written(message.layout, one, in_order[one.places], next(counter)) for one in message.pages]
        return frames


def _written(layout: MessageLayout, page: OutputPage, values: Floats, number: int) -> OutputFrame:
    """The `number`-th frame of a message, with values (signals of the page,)."""
    payload = page.blank.copy()
    core.encode_signals(values, page.table, payload)
    core.protect_frame(payload, layout.length, layout.protection, number)
    return output_frame(layout, payload.tobytes())


class ResultFrames:
    """Collects frames with rates and summaries in the order they are made."""

    def __init__(self, bus: BusMap, publisher: Publisher, injector_id: int) -> None:
        self._rate_layout = bus.rate.layout if bus.rate else None
        self._publisher = publisher
        self._ready = publisher.memory["frames"]
        self._writer = FrameWriter(bus.results_of(per_injection=True))
        self._corrected, self._corrected_counter = bus.corrected, count()
        self._injector_id = injector_id
        self._frames: list[OutputFrame] = []

    def collect_results(self) -> None:
        """Collect the frames that the publisher has ready."""
        if self._rate_layout is None or self._ready[0] == 0:
            return
        for frame in self._publisher.out[: int(self._ready[0])]:
            self._frames.append(output_frame(self._rate_layout, frame["payload"][: int(frame["length"])].tobytes()))
        self._ready[0] = 0

    def add_summary(self, report: InjectionReport, learning: bool, pressure_scale: float) -> None:
        """Write the summary of an injection, and its corrected rate; pressure_scale p_0 [Pa]."""
        parts = {
            "report": report,
            "learning": learning,
            "injector_id": self._injector_id,
            "mass_sigma": report.mass_bound / Z_95,
            "line_pressure_offset": report.indicators[OFFSET].value * pressure_scale,
        }
        self._frames += self._writer.write(parts)
        if self._corrected is not None and report.corrected_rate is not None:
            self._add_rates(self._corrected, report, report.corrected_rate / MM3_PER_MS, learning)

    def _add_rates(self, message: RateMessage, report: InjectionReport, rates: NDArray[Any], learning: bool) -> None:
        """Write rates [mm3/ms] of an injection in blocks like those of the live rate, as valid as its mass."""
        padded = np.pad(rates, (0, -len(rates) % message.samples), constant_values=np.nan)
        for number, block in enumerate(padded.reshape(-1, message.samples)):
            index = (report.start_index + number * message.samples) % INDICES
            header = dict(zip(HEADER_SIGNALS, (index, report.valid, learning, report.state), strict=True))
            values = np.array([*(header[name] for name in message.page.names[: -message.samples]), *block])
            self._frames.append(_written(message.layout, message.page, values, next(self._corrected_counter)))

    def taken(self) -> list[OutputFrame]:
        """All frames since the last call; of rates those that `collect_results` has collected."""
        frames, self._frames = self._frames, []
        return frames


def value_of(source: str, parts: Mapping[str, Any]) -> Any:
    """Value that a source names: a part, then its column, key or attribute; None without it, sums over records."""
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
    """Counts since the start; annotated with their sources where no signal of the status has them."""

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
    unseen_injections: Annotated[int, "observer.counts.unseen_injections"]
    """Falls of the line pressure as by an injection, that neither lift nor command began."""
    adoptions: int
    rejected_adoptions: int
    late_adoptions: int
    unlearned_events: int
    commands: Annotated[int, "energizing.commands"]
    """Energizings of the injector; 0, as the next, where that is no input."""
    missing_injections: int

    @property
    def outliers(self) -> str:
        """Describes spikes and bridged values; empty: there were none."""
        if not self.spikes and not self.bridged_samples:
            return ""
        spikes = f"{self.spikes} spike{'s' * (self.spikes != 1)} replaced"
        return f"{spikes}, {self.bridged_samples} values of frozen or missing inputs bridged"

    def since(self, earlier: "Counters") -> "Counters":
        """Counts since an earlier look."""
        return Counters(**{name: now - getattr(earlier, name) for name, now in vars(self).items()})


_SOURCES = {
    name: hint.__metadata__[0] if hasattr(hint, "__metadata__") else rows_of(StatusValues)[name].source
    for name, hint in get_type_hints(Counters, include_extras=True).items()
}


def counted(parts: Mapping[str, Any]) -> Counters:
    return Counters(**{name: value_of(source, parts) or 0 for name, source in _SOURCES.items()})
