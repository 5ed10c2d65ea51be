"""From bench file and bus database to arrays: which frames carry which samples, which carry the results."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import can.util
import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.bench_databases import BenchDatabases, BusMessage, named
from observer_rt.bus.database import MessageLayout, find_signal, signal_names
from observer_rt.bus.e2e import UNPROTECTED
from observer_rt.bus.inputs import INPUT_GROUP, INPUT_MESSAGE, ROLES, Inputs, InputTables
from observer_rt.bus.outputs import (
    STATUS_SIGNALS,
    SUMMARY_SIGNALS,
    OutputMessage,
    RateMessage,
    output_message,
    protected_layout,
    rate_message,
)
from observer_rt.bus.sample_groups import SampleGroup, require_carried, sample_groups
from observer_rt.bus.slow_inputs import SlowMessage, SlowSignal, say_nothing, slow_signal, slow_timeout
from observer_rt.bus.timing import INDEX_BITS, Following, following, map_timing, number_signal
from observer_rt.config import (
    Bench,
    FuelTemperatureConfig,
    LearningEnableConfig,
    OptionalRole,
    Role,
    SlowQuantityConfig,
    SlowSignalConfig,
)
from observer_rt.errors import UserError
from observer_rt.units import LENGTH_UNITS, MASS_UNITS, PRESSURE_UNITS, TEMPERATURE_ORIGINS

# Added to the id of a frame, so that one number names it on all buses.
EXTENDED = 1 << 32
BUS = 1 << 33  # for each bus before its own
_UNITS = {
    Role.RAIL_PRESSURE: PRESSURE_UNITS,
    Role.NEEDLE_LIFT: LENGTH_UNITS,
    Role.LINE_PRESSURE: PRESSURE_UNITS,
}


def frame_key(frame_id: int, is_extended: bool, bus: int = 0) -> int:
    """One number for id and format of a frame on a bus."""
    return frame_id + (EXTENDED if is_extended else 0) + BUS * bus


@dataclass(frozen=True)
class KnownMessage:
    """A message that some database defines, for a bus; `key` as by `frame_key`."""

    name: str
    key: int
    path: Path
    bus: int


@dataclass(frozen=True)
class BusMap:
    """Everything the bench file says of the bus, compiled."""

    inputs: Inputs
    input_layouts: tuple[MessageLayout, ...]
    slow: tuple[SlowMessage, ...]
    """Messages with optional inputs."""
    following: tuple[Following | None, ...]  # how a stream that is not on the grid follows it
    rate: RateMessage | None
    """None: the injection rate is not published."""
    summary: OutputMessage
    status: OutputMessage
    known: tuple[KnownMessage, ...]
    """All messages of all databases, used or not."""
    overlooked: tuple[str, ...]
    """What is wrong with databases that were read leniently."""
    labels: tuple[str, ...]
    """What messages to the user call the buses."""

    @property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that something is read from, once."""
        return (*self.input_layouts, *(slow.layout for slow in self.slow if not slow.is_input))

    @property
    def sent(self) -> tuple[MessageLayout, ...]:
        """Every message the results go out in."""
        return tuple(output.layout for output in (self.rate, self.summary, self.status) if output is not None)

    def received_on(self, bus: int) -> list[tuple[int, bool]]:
        """(identifier, is extended) to be read from a bus.

        Of one with results only they are those of the results, which nobody else sends: a link that reads nothing
        would not hear what its controller tells either.
        """
        wanted = [layout for layout in self.received if layout.bus == bus]
        wanted = wanted or [layout for layout in self.sent if layout.bus == bus]
        return [(layout.frame_id, layout.is_extended) for layout in wanted]

    def name_of(self, layout: MessageLayout) -> str:
        """Its name and, where there are several, its bus."""
        return f"{layout.name} on {self.labels[layout.bus]}" if len(self.labels) > 1 else layout.name


def stream_of(bus: BusMap, role: Role) -> int:
    """Number of the stream that carries a role."""
    bit = 1 << ROLES.index(role)
    return next(n for n, stream in enumerate(bus.inputs.streams) if int(stream["roles"]) & bit)


def layout_of(bus: BusMap, stream: int) -> MessageLayout:
    """The input message that carries a stream."""
    group = int(np.flatnonzero(bus.inputs.groups["stream"] == stream)[0])
    number = int(np.searchsorted(bus.inputs.messages["first_group"], group, side="right")) - 1
    return bus.input_layouts[number]


def map_bus(bench: Bench) -> BusMap:
    """Compile the mapping of a bench file.

    Raises `UserError` naming bench file, key and what the database has instead.
    """
    databases = BenchDatabases(bench)
    inputs, layouts = _map_inputs(bench, databases)
    slow = _map_slow(bench, databases, layouts)
    _say_nothing(inputs, slow)
    outputs = bench.config.outputs

    def output(key: str, name: str) -> BusMessage:
        return databases.find(f"outputs.{key}", name, outputs.link)

    return BusMap(
        inputs=inputs,
        input_layouts=layouts,
        slow=slow,
        following=tuple(following(bench, inputs.timing, inputs.streams["roles"].tolist())),
        rate=rate_message(*output("injection_rate", outputs.injection_rate))
        if outputs.injection_rate
        else None,
        summary=_output(output("injection_summary", outputs.injection_summary), SUMMARY_SIGNALS),
        status=_output(output("status", outputs.status), STATUS_SIGNALS),
        known=tuple(
            KnownMessage(message.name, frame_key(message.frame_id, message.is_extended_frame, bus), path, bus)
            for path, (message, bus) in databases
        ),
        overlooked=databases.overlooked(),
        labels=tuple(link.label for link in bench.config.buses),
    )


def _output(on_bus: BusMessage, known: Sequence[str]) -> OutputMessage:
    return output_message(on_bus.message, known, on_bus.bus)


def _map_inputs(bench: Bench, databases: BenchDatabases) -> tuple[Inputs, tuple[MessageLayout, ...]]:
    by_message: dict[tuple[str, int], tuple[BusMessage, list[Role]]] = {}
    for role in ROLES:
        config = bench.config.signals.of(role)
        found = databases.find(f"signals.{role}.message", config.message, config.link)
        by_message.setdefault((config.message, found.bus), (found, []))[1].append(role)
    tables = InputTables()
    layouts = []
    streams: list[tuple[BusMessage, list[Role]]] = []
    for found, roles in by_message.values():
        layout = protected_layout(*found)
        layouts.append(layout)
        row = _frame_row(layout)
        streams += [(found, together) for together in _map_message(bench, found.message, roles, row, tables)]
    timing = map_timing(
        bench,
        [(found.message, roles) for found, roles in streams],
        [bench.config.buses[found.bus].config for found, _ in streams],
        tables.stream_samples,
    )
    _require_one_rate(bench, streams, timing["steps"].tolist())
    return tables.inputs(timing), tuple(layouts)


def _frame_row(layout: MessageLayout) -> NDArray[np.void]:
    """What tells whether a frame is a good one of this message; the rest is 0."""
    row = np.zeros((), INPUT_MESSAGE)
    row["key"] = frame_key(layout.frame_id, layout.is_extended, layout.bus)
    row["length"] = layout.length
    row["padded_length"] = can.util.dlc2len(can.util.len2dlc(layout.length))
    row["e2e_profile"] = layout.e2e_profile or UNPROTECTED
    row["data_id"] = layout.e2e_data_id or 0
    return row


def _map_slow(
    bench: Bench, databases: BenchDatabases, inputs: Sequence[MessageLayout]
) -> tuple[SlowMessage, ...]:
    by_message: dict[tuple[str, int], tuple[BusMessage, list[tuple[OptionalRole, SlowSignalConfig]]]] = {}
    for role, config in bench.config.signals.optional:
        found = databases.find(f"signals.{role}.message", config.message, config.link)
        by_message.setdefault((config.message, found.bus), (found, []))[1].append((role, config))
    slow = []
    for found, mappings in by_message.values():
        layout = protected_layout(*found)
        signals = tuple(_slow_signal(bench, found.message, layout, role, config) for role, config in mappings)
        slow.append(SlowMessage(layout, _frame_row(layout)[None], signals, layout in inputs))
    return tuple(slow)


def _slow_signal(
    bench: Bench, message: Message, layout: MessageLayout, role: OptionalRole, config: SlowSignalConfig
) -> SlowSignal:
    place = f"{bench.path}: signals.{role}"
    with named(place):
        find_signal(message, config.signal)
    factor, origin, untold, timeout = 1.0, 0.0, math.nan, math.inf
    if isinstance(config, FuelTemperatureConfig):
        origin = _from_unit(place, message, config.signal, config.unit, TEMPERATURE_ORIGINS)
        untold = bench.injector.fluid.reference_temperature or math.nan
    elif isinstance(config, SlowQuantityConfig):
        factor = _from_unit(place, message, config.signal, config.unit, MASS_UNITS)
    with named(place):
        signal = slow_signal(message, role, config.signal, factor, origin)
    if isinstance(config, LearningEnableConfig) and not signal.has_not_available:
        untold = 1.0  # a frame made of a recording must not switch learning off
    if isinstance(config, FuelTemperatureConfig | LearningEnableConfig):
        timeout = slow_timeout(config.timeout_ms, layout.cycle_time_ns)
    return replace(signal, untold=untold, timeout=timeout)


def _say_nothing(inputs: Inputs, slow: Sequence[SlowMessage]) -> None:
    """Frames made of recordings, which have no optional inputs, must not tell any."""
    for message in slow:
        for row in inputs.messages[inputs.messages["key"] == message.frame[0]["key"]]:
            first = int(row["first_kind"])
            for kind in inputs.kinds[first : first + int(row["kind_count"])]:
                say_nothing(message, kind["blank"])


def _map_message(
    bench: Bench, message: Message, roles: Sequence[Role], row: NDArray[np.void], tables: InputTables
) -> list[list[Role]]:
    """Add a message to the tables; returns the roles of each of its streams."""
    samples: dict[Role, tuple[str, ...]] = {}
    streams: dict[tuple[SampleGroup, ...], list[Role]] = {}
    for role in roles:
        with named(f"{bench.path}: signals.{role}"):
            samples[role] = signal_names(message, bench.config.signals.of(role).names)
            groups = sample_groups(message, samples[role])
        if row["samples"] not in (0, len(samples[role])):
            raise UserError(
                f"{bench.path}: signals.{role}",
                f"has {len(samples[role])} samples a frame, other signals of {message.name} have {row['samples']}",
                "name as many samples for every signal of a message",
            )
        row["samples"] = len(samples[role])
        streams.setdefault(groups, []).append(role)
    for groups, together in streams.items():
        number = number_signal(bench, message, together)
        if number is not None:
            with named(f"{bench.path}: signals.{together[0]}"):
                require_carried(message, number.name, groups)
        if any(group.conditions for group in groups) and (number is None or number.length != INDEX_BITS):
            raise UserError(
                f"{bench.path}: signals.{together[0]}.index",
                f"{message.name} sends samples in turns under a multiplexer, but no sample index with them",
                "name the signal with the index of the frame's first sample",
            )
        for group in groups:
            group_row = np.zeros((), INPUT_GROUP)
            names = [] if number is None else [number.name]
            for role in together:
                place = ROLES.index(role)
                group_row["position"][place] = len(names)
                group_row["factor"][place] = _factor(bench, message, role, samples[role])
                names.extend(samples[role][group.offset : group.offset + group.count])
            tables.add_group(group_row, message, names, group)
        tables.add_stream(int(row["samples"]), sum(1 << ROLES.index(role) for role in together))
    tables.add_message(row, message, [group for groups in streams for group in groups])
    return list(streams.values())


def _require_one_rate(
    bench: Bench, streams: Sequence[tuple[BusMessage, list[Role]]], steps: Sequence[int]
) -> None:
    """Streams of one message share its index."""
    names = [(found.message.name, found.bus) for found, _ in streams]
    for name, (_, roles), ratio in zip(names, streams, steps, strict=True):
        if ratio > 1 and names.count(name) > 1:
            raise UserError(
                f"{bench.path}: signals.{roles[0]}.rate_hz",
                f"{name[0]} carries other signals under the same sample index",
                "leave rate_hz out: all signals of one message are sampled alike",
            )


def _factor(bench: Bench, message: Message, role: Role, samples: Sequence[str]) -> float:
    place = f"{bench.path}: signals.{role}"
    return _from_unit(place, message, samples[0], bench.config.signals.of(role).unit, _UNITS[role])


def _from_unit(
    place: str, message: Message, signal: str, unit: str | None, units: Mapping[str, float]
) -> float:
    """What `units` holds for the unit of a signal: `unit` of the bench file, or else what the database states."""
    stated = unit or find_signal(message, signal).unit or ""
    if stated not in units:
        raise UserError(
            place,
            f"unit {stated!r} of {message.name} is not known" if stated else f"{message.name} states no unit",
            f'add unit = "..." with one of {", ".join(units)}',
        )
    return units[stated]
