"""From bench file and bus database to arrays: which frames carry which samples, which carry the results."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.can_frame import STANDARD_MASK
from observer_rt.bus.database.catalogue import BenchDatabases, BusMessage, named
from observer_rt.bus.database.lookup import MessageLayout, signal_names
from observer_rt.bus.database.signal_unit import from_unit
from observer_rt.bus.mapping.energizing import EnergizingLayout
from observer_rt.bus.mapping.input_tables import INPUT_GROUP, ROLES, Inputs, InputTables, frame_row
from observer_rt.bus.mapping.optional_inputs import SlowMessage, map_optional, say_nothing
from observer_rt.bus.mapping.output_messages import (
    OutputMessage,
    RateMessage,
    StatusValues,
    SummaryValues,
    output_message,
    protected_layout,
    rate_message,
    signals_of,
)
from observer_rt.bus.mapping.sample_groups import (
    SampleGroup,
    require_carried,
    require_one_rate,
    sample_groups,
)
from observer_rt.bus.mapping.timing import INDEX_BITS, Following, following, map_timing, number_signal
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.config.signals import Role
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import LENGTH_UNITS, PRESSURE_UNITS

_UNITS = {
    Role.RAIL_PRESSURE: PRESSURE_UNITS,
    Role.NEEDLE_LIFT: LENGTH_UNITS,
    Role.LINE_PRESSURE: PRESSURE_UNITS,
}
Compiled = TypeVar("Compiled", RateMessage, OutputMessage)


@dataclass(frozen=True)
class BusMap:
    """Everything the bench file says of one injector on the buses, compiled."""

    inputs: Inputs
    input_layouts: tuple[MessageLayout, ...]
    slow: tuple[SlowMessage, ...]
    """Messages with optional inputs."""
    following: tuple[Following | None, ...]  # how a stream that is not on the grid follows it
    rate: RateMessage | None
    """None: the injection rate is not published."""
    summary: OutputMessage
    status: OutputMessage
    labels: tuple[str, ...]
    """What messages to the user call the buses."""

    @property
    def energizing(self) -> EnergizingLayout | None:
        """Where it is among them."""
        return next((slow.energizing for slow in self.slow if slow.energizing), None)

    @property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that something is read from, once."""
        return tuple(dict.fromkeys((*self.input_layouts, *(slow.layout for slow in self.slow))))

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
        return [(layout.received_id, layout.is_extended) for layout in wanted]

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
    """Compile the mapping of a bench with one injector.

    Raises `UserError` naming bench file, key and what the database has instead.
    """
    return map_injector(bench.injector, BenchDatabases(bench))


def map_injector(fitted: BenchInjector, databases: BenchDatabases) -> BusMap:
    """Compile the mapping of one injector of a bench, whose `databases` are all injectors'; raises as `map_bus`."""
    inputs, layouts, slow = _map_inputs(fitted, databases)
    outputs = fitted.config.outputs

    def output(key: str, compile_message: Callable[[Message, int], Compiled]) -> Compiled:
        place = fitted.place(f"outputs.{key}")
        message, number = databases.find(place, getattr(outputs, key), outputs.link)
        with named(place):
            return compile_message(_moved(message, getattr(outputs, f"{key}_id")), number)

    return BusMap(
        inputs=inputs,
        input_layouts=layouts,
        slow=slow,
        following=tuple(following(fitted, inputs.timing, inputs.streams["roles"].tolist())),
        rate=output("injection_rate", rate_message) if outputs.injection_rate else None,
        summary=output("injection_summary", partial(_output, SummaryValues)),
        status=output("status", partial(_output, StatusValues)),
        labels=databases.labels,
    )


def _moved(message: Message, identifier: int | None) -> Message:
    """The message under another identifier, if one is given."""
    if identifier is None:
        return message
    moved = copy(message)
    moved.is_extended_frame = message.is_extended_frame or identifier > STANDARD_MASK
    moved.frame_id = identifier
    return moved


def _output(values: type[SummaryValues] | type[StatusValues], message: Message, bus: int) -> OutputMessage:
    return output_message(message, signals_of(values), bus)


def _map_inputs(
    fitted: BenchInjector, databases: BenchDatabases
) -> tuple[Inputs, tuple[MessageLayout, ...], tuple[SlowMessage, ...]]:
    """The tables of all inputs, the messages that carry samples, and those with optional inputs."""
    by_message: dict[tuple[str, int], tuple[BusMessage, list[Role]]] = {}
    for role in ROLES:
        config = fitted.config.signals.of(role)
        found = databases.find(fitted.place(f"signals.{role}.message"), config.message, config.link)
        by_message.setdefault((config.message, found.bus), (found, []))[1].append(role)
    tables = InputTables()
    layouts = []
    streams: list[tuple[BusMessage, list[Role]]] = []
    for found, roles in by_message.values():
        with named(fitted.place(f"signals.{roles[0]}.message")):
            layout = protected_layout(*found)
        layouts.append(layout)
        row = frame_row(layout)
        streams += [(found, together) for together in _map_message(fitted, found.message, roles, row, tables)]
    timing = map_timing(
        fitted,
        [(found.message, roles) for found, roles in streams],
        [databases.links[found.bus] for found, _ in streams],
        tables.stream_samples,
    )
    require_one_rate(fitted, streams, timing["steps"].tolist())
    slow = map_optional(fitted, databases, tables, timing)
    inputs = tables.inputs(timing)
    say_nothing(inputs, slow)
    return inputs, tuple(layouts), slow


def _map_message(
    fitted: BenchInjector, message: Message, roles: Sequence[Role], row: NDArray[np.void], tables: InputTables
) -> list[list[Role]]:
    """Add a message to the tables; returns the roles of each of its streams."""
    samples: dict[Role, tuple[str, ...]] = {}
    streams: dict[tuple[SampleGroup, ...], list[Role]] = {}
    for role in roles:
        with named(fitted.place(f"signals.{role}")):
            samples[role] = signal_names(message, fitted.config.signals.of(role).names)
            groups = sample_groups(message, samples[role])
        if row["samples"] not in (0, len(samples[role])):
            raise UserError(
                fitted.place(f"signals.{role}"),
                f"has {len(samples[role])} samples a frame, other signals of {message.name} have {row['samples']}",
                "name as many samples for every signal of a message",
            )
        row["samples"] = len(samples[role])
        streams.setdefault(groups, []).append(role)
    for groups, together in streams.items():
        number = number_signal(fitted, message, together)
        if number is not None:
            with named(fitted.place(f"signals.{together[0]}")):
                require_carried(message, number.name, groups)
        if any(group.conditions for group in groups) and (number is None or number.length != INDEX_BITS):
            raise UserError(
                fitted.place(f"signals.{together[0]}.index"),
                f"{message.name} sends samples in turns under a multiplexer, but no sample index with them",
                "name the signal with the index of the frame's first sample",
            )
        for group in groups:
            group_row = np.zeros((), INPUT_GROUP)
            names = [] if number is None else [number.name]
            for role in together:
                place = ROLES.index(role)
                group_row["position"][place] = len(names)
                group_row["factor"][place] = _factor(fitted, message, role, samples[role])
                names.extend(samples[role][group.offset : group.offset + group.count])
            with named(fitted.place(f"signals.{together[0]}")):
                tables.add_group(group_row, message, names, group)
        tables.add_stream(int(row["samples"]), sum(1 << ROLES.index(role) for role in together))
    tables.add_message(row, message, [group for groups in streams for group in groups])
    return list(streams.values())


def _factor(fitted: BenchInjector, message: Message, role: Role, samples: Sequence[str]) -> float:
    place = fitted.place(f"signals.{role}")
    return from_unit(place, message, samples[0], fitted.config.signals.of(role).unit, _UNITS[role])
