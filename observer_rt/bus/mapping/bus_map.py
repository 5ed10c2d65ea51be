"""Mapping of bench file and bus databases to arrays: frames with samples and with results, by injector."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from cantools.database.can import Message

from observer_rt.bus.can_frame import STANDARD_MASK, frame_key
from observer_rt.bus.database.catalogue import BenchDatabases, BusMessage, locating
from observer_rt.bus.database.lookup import INDEX_BITS, MessageLayout, from_unit, signal_names
from observer_rt.bus.mapping import input_tables, output_messages
from observer_rt.bus.mapping.output_signals import RESULTS, signals_of
from observer_rt.bus.mapping.timing import GridRelation, grid_relations, map_timing, number_signal
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import INPUT_GROUP
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import LENGTH_UNITS, PRESSURE_UNITS, Structs

if TYPE_CHECKING:
    from observer_rt.bus.mapping.optional_inputs import EnergizingLayout, SlowMessage

_UNITS = {Role.RAIL_PRESSURE: PRESSURE_UNITS, Role.NEEDLE_LIFT: LENGTH_UNITS, Role.LINE_PRESSURE: PRESSURE_UNITS}
Compiled = TypeVar("Compiled", output_messages.RateMessage, output_messages.OutputMessage)


@dataclass(frozen=True)
class BusMap:
    """Messages and signals of one injector on the buses, compiled from the bench file."""

    inputs: input_tables.Inputs
    input_layouts: tuple[MessageLayout, ...]
    slow: "tuple[SlowMessage, ...]"
    """Messages with optional inputs."""
    grid_relations: tuple[GridRelation | None, ...]  # of each stream, None where all of it is on the grid
    rate: output_messages.RateMessage | None
    """Message of the injection rate; None: it is not published."""
    corrected: output_messages.RateMessage | None  # the same of the corrected rate
    results: Mapping[str, output_messages.OutputMessage]
    """Messages of results, by their keys in `[outputs]`."""
    has_lift: bool
    """Whether the needle lift is used, where it is read at all."""
    labels: tuple[str, ...]
    """Names of the buses in messages to the user."""

    @property
    def energizing(self) -> "EnergizingLayout | None":
        """Layout of the energizing; None where no message carries it."""
        return next((slow.energizing for slow in self.slow if slow.energizing), None)

    @property
    def tells_commands(self) -> bool:
        """Whether the bus carries to the sample when the injector is energized."""
        return self.energizing is not None and self.energizing.tells_samples

    @cached_property
    def spared(self) -> frozenset[int]:
        """Numbers of the streams that nothing waits for: of a needle lift alone, where it is not used."""
        lift, streams = 1 << input_tables.ROLES.index(Role.NEEDLE_LIFT), self.inputs.streams["roles"].tolist()
        return frozenset(number for number, roles in enumerate(streams) if roles == lift and not self.has_lift)

    @property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that something is read from, once."""
        return tuple(dict.fromkeys((*self.input_layouts, *(slow.layout for slow in self.slow))))

    @property
    def sent(self) -> tuple[MessageLayout, ...]:
        """Every message the results go out in."""
        outputs = (self.rate, self.corrected, *self.results.values())
        return tuple(output.layout for output in outputs if output is not None)

    @property
    def buses(self) -> frozenset[int]:
        """Numbers of the buses that something is read from or sent to."""
        return frozenset(layout.bus for layout in (*self.received, *self.sent))

    def results_of(self, per_injection: bool) -> list[tuple[Any, output_messages.OutputMessage]]:
        """Messages of an injection, or those of a moment, each behind the table of its values."""
        kinds = ((RESULTS[key], message) for key, message in self.results.items())
        return [(kind.values, message) for kind, message in kinds if kind.per_injection == per_injection]

    def name_of(self, layout: MessageLayout) -> str:
        """Name of a message and, where there are several, of its bus."""
        return f"{layout.name} on {self.labels[layout.bus]}" if len(self.labels) > 1 else layout.name


def timing_row(bus: BusMap, number: int) -> np.void:
    """Row TIMING of an input message, whose streams share index and rate."""
    group = bus.inputs.groups[int(bus.inputs.messages[number]["first_group"])]
    timing: np.void = bus.inputs.timing[int(group["stream"])]
    return timing


def stream_of(bus: BusMap, role: Role) -> int:
    """Number of the stream that carries a role."""
    bit = 1 << input_tables.ROLES.index(role)
    return next(n for n, stream in enumerate(bus.inputs.streams) if int(stream["roles"]) & bit)


def layout_of(bus: BusMap, stream: int) -> MessageLayout:
    """The input message that carries a stream."""
    group = int(np.flatnonzero(bus.inputs.groups["stream"] == stream)[0])
    number = int(np.searchsorted(bus.inputs.messages["first_group"], group, side="right")) - 1
    return bus.input_layouts[number]


def map_bus(bench: Bench) -> BusMap:
    """Compile a bench's mapping with one injector. Raises `UserError` naming bench file, key and alternatives."""
    return _map_injector(bench.injector, BenchDatabases(bench))


def _map_injector(injector: BenchInjector, databases: BenchDatabases) -> BusMap:
    """Compile one injector's mapping, whose `databases` are all injectors'. Raises as `map_bus`."""
    inputs, layouts, slow = _map_inputs(injector, databases)
    outputs = injector.config.outputs

    def output(key: str, compile_message: Callable[..., Compiled]) -> Compiled:
        location = injector.location(f"outputs.{key}")
        message, number = databases.find(location, getattr(outputs, key), outputs.link)
        with locating(location):
            return compile_message(_renumbered(message, getattr(outputs, f"{key}_id")), bus=number)

    return BusMap(
        inputs=inputs,
        input_layouts=layouts,
        slow=slow,
        grid_relations=tuple(grid_relations(injector, inputs.timing, inputs.streams["roles"].tolist())),
        rate=output("injection_rate", output_messages.rate_message) if outputs.injection_rate else None,
        corrected=output("corrected_rate", output_messages.rate_message) if outputs.corrected_rate else None,
        results={
            key: output(key, partial(output_messages.output_message, signals=signals_of(result.values)))
            for key, result in RESULTS.items()
            if getattr(outputs, key)
        },
        has_lift=injector.has_lift,
        labels=databases.labels,
    )


def _renumbered(message: Message, identifier: int | None) -> Message:
    if identifier is None:
        return message
    moved = copy(message)
    moved.is_extended_frame = message.is_extended_frame or identifier > STANDARD_MASK
    moved.frame_id = identifier
    return moved


def _map_inputs(
    injector: BenchInjector, databases: BenchDatabases
) -> "tuple[input_tables.Inputs, tuple[MessageLayout, ...], tuple[SlowMessage, ...]]":
    """The tables of all inputs, the messages that carry samples, and those with optional inputs."""
    by_message: dict[tuple[str, int], tuple[BusMessage, list[Role]]] = {}
    for role in input_tables.ROLES:
        config = injector.config.signals.of(role)
        source = databases.find(injector.location(f"signals.{role}.message"), config.message, config.link)
        by_message.setdefault((config.message, source.bus), (source, []))[1].append(role)
    tables = input_tables.InputTables()
    layouts = []
    streams: list[tuple[BusMessage, list[Role]]] = []
    for source, roles in by_message.values():
        with locating(injector.location(f"signals.{roles[0]}.message")):
            layout = output_messages.protected_layout(*source)
        layouts.append(layout)
        row = input_tables.frame_row(layout)
        streams += [(source, together) for together in _map_message(injector, source.message, roles, row, tables)]
    timing = map_timing(
        injector,
        [(source.message, roles) for source, roles in streams],
        [databases.links[source.bus] for source, _ in streams],
        [samples for samples, _ in tables.streams],
    )
    input_tables.require_one_rate(injector, streams, timing["steps"].tolist())
    signals = injector.config.signals
    if not signals.optional and signals.energizing is None:
        return tables.inputs(timing), tuple(layouts), ()
    from observer_rt.bus.mapping.optional_inputs import fill_blank_frames, map_optional  # few benches have any

    slow = map_optional(injector, databases, tables, timing)
    inputs = tables.inputs(timing)
    fill_blank_frames(inputs, slow)
    return inputs, tuple(layouts), slow


def _map_message(
    injector: BenchInjector, message: Message, roles: Sequence[Role], row: Structs, tables: input_tables.InputTables
) -> list[list[Role]]:
    """Add a message to the tables; returns the roles of each of its streams."""
    signals, places = injector.config.signals, {role: injector.location(f"signals.{role}") for role in roles}
    measured = {role for role in roles if role is not Role.NEEDLE_LIFT or signals.needle_lift is not None}
    samples: dict[Role, tuple[str, ...]] = {}
    streams: dict[tuple[input_tables.SampleGroup, ...], list[Role]] = {}
    for role in roles:
        with locating(places[role]):
            names = signal_names(message, signals.of(role).names)
            groups = input_tables.sample_groups(message, names)
        if row["samples"] not in (0, len(names)):
            problem = f"has {len(names)} samples a frame, other signals of {message.name} have {row['samples']}"
            raise UserError(places[role], problem, "name as many samples for every signal of a message")
        for other in (other for other in samples if {other, role} <= measured):
            if set(samples[other]) & set(names):
                problem = f"{other} and {role} read the same signals of {message.name}"
                raise UserError(places[role], problem, "name the signals of each")
        samples[role], row["samples"] = names, len(names)
        streams.setdefault(groups, []).append(role)
    for groups, together in streams.items():
        number, location = number_signal(injector, message, together), places[together[0]]
        if number is not None:
            with locating(location):
                input_tables.require_carried(message, number.name, groups)
        if any(group.conditions for group in groups) and (number is None or number.length != INDEX_BITS):
            problem = f"{message.name} sends samples in turns under a multiplexer, but no sample index with them"
            remedy = "name the signal with the index of the frame's first sample"
            raise UserError(f"{location}.index", problem, remedy)
        for group in groups:
            group_row, carried = np.zeros((), INPUT_GROUP), [] if number is None else [number.name]
            for role in together:
                column, unit, names = input_tables.ROLES.index(role), signals.of(role).unit, samples[role]
                group_row["position"][column] = len(carried)
                if role in measured:
                    group_row["factor"][column] = from_unit(places[role], message, names[0], unit, _UNITS[role])
                carried += names[group.offset : group.offset + group.count]
            with locating(location):
                tables.add_group(group_row, message, carried, group, None if number is None else number.name)
        tables.streams.append((int(row["samples"]), sum(1 << input_tables.ROLES.index(role) for role in together)))
    tables.add_message(row, message, [group for groups in streams for group in groups])
    return list(streams.values())


class KnownMessage(NamedTuple):
    """A message that some database defines, for a bus; `key` as by `frame_key`."""

    name: str
    key: int
    path: Path
    bus: int


@dataclass(frozen=True)
class BenchMap:
    """Messages and signals of all injectors of a bench file, compiled; `injectors` in its order."""

    injectors: tuple[BusMap, ...]
    database_messages: tuple[KnownMessage, ...]
    """All messages of all databases, used or not."""
    overlooked_faults: tuple[str, ...]
    """Faults of databases that were read leniently."""

    @cached_property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that some injector reads something from, once."""
        return _unique(layout for bus in self.injectors for layout in bus.received)

    @cached_property
    def sent(self) -> tuple[MessageLayout, ...]:
        """Every message that some injector's results go out in, once."""
        return _unique(layout for bus in self.injectors for layout in bus.sent)

    @property
    def layouts(self) -> tuple[MessageLayout, ...]:
        """Every message received, then every one sent."""
        return (*self.received, *self.sent)

    def name_of(self, layout: MessageLayout) -> str:
        """Name of a message and, where there are several, of its bus."""
        return self.injectors[0].name_of(layout)


def map_bench(bench: Bench) -> BenchMap:
    """The mapping of all injectors, compiled. Raises `UserError` with file, key and what the database has instead."""
    databases = BenchDatabases(bench)
    return BenchMap(
        tuple(_map_injector(injector, databases) for injector in bench.injectors),
        tuple(
            KnownMessage(message.name, frame_key(message.frame_id, message.is_extended_frame, bus), path, bus)
            for path, (message, bus) in databases
        ),
        databases.overlooked_faults(),
    )


def shared_resources(bench: Bench, mapped: BenchMap) -> Iterator[tuple[str, list[str]]]:
    """Messages, numbers and files that several injectors must not share but do, each with the injectors' names."""
    owners: dict[str, list[str]] = {}
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        for layout in bus.sent:
            owners.setdefault(f"the message {mapped.name_of(layout)} 0x{layout.frame_id:X}", []).append(injector.name)
        owners.setdefault(f"outputs.injector_id = {injector.config.outputs.injector_id}", []).append(injector.name)
        for key, file in (("file", injector.state), ("journal", injector.journal)):
            if file is not None:
                owners.setdefault(f"state.{key} = {file}", []).append(injector.name)
    return ((resource, names) for resource, names in owners.items() if len(names) > 1)


def _unique(layouts: Iterable[MessageLayout]) -> tuple[MessageLayout, ...]:
    return tuple({(layout.name, layout.bus, layout.frame_id): layout for layout in layouts}.values())
