"""From bench file and bus database to arrays: which frames carry which samples, which carry the results."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import can.util
import numpy as np
from cantools.database.can import Database, Message
from numpy.typing import NDArray

from observer_rt.bus.database import MessageLayout, find_message, find_signal, signal_names
from observer_rt.bus.database_file import load_database, overlooked
from observer_rt.bus.e2e import UNPROTECTED
from observer_rt.bus.energizing import Energizing, map_energizing, say_no_energizing
from observer_rt.bus.inputs import INPUT_GROUP, INPUT_MESSAGE, ROLES, Inputs, InputTables
from observer_rt.bus.outputs import (
    ENERGIZING_STATUS_SIGNALS,
    STATUS_SIGNALS,
    SUMMARY_SIGNALS,
    OutputMessage,
    RateMessage,
    output_message,
    protected_layout,
    rate_message,
)
from observer_rt.bus.sample_groups import SampleGroup, require_carried, require_one_rate, sample_groups
from observer_rt.bus.slow_inputs import SlowMessage, set_unknown, slow_signal
from observer_rt.bus.timing import INDEX_BITS, Following, Joining, following, map_timing, number_signal
from observer_rt.config import Bench, OptionalRole, Role, SlowQuantityConfig, SlowSignalConfig
from observer_rt.errors import UserError
from observer_rt.units import LENGTH_UNITS, MASS_UNITS, PRESSURE_UNITS

EXTENDED = 1 << 32  # added to the id of an extended frame, so that one number names a frame
_UNITS = {
    Role.RAIL_PRESSURE: PRESSURE_UNITS,
    Role.NEEDLE_LIFT: LENGTH_UNITS,
    Role.LINE_PRESSURE: PRESSURE_UNITS,
}


def frame_key(frame_id: int, is_extended: bool) -> int:
    """One number for id and format of a frame."""
    return frame_id + (EXTENDED if is_extended else 0)


@dataclass(frozen=True)
class KnownMessage:
    """A message that some database defines; `key` as by `frame_key`."""

    name: str
    key: int
    path: Path


@dataclass(frozen=True)
class BusMap:
    """Everything the bench file says of the bus, compiled."""

    inputs: Inputs
    input_layouts: tuple[MessageLayout, ...]
    slow: tuple[SlowMessage, ...]
    """Messages with optional inputs."""
    energizing: Energizing | None
    following: tuple[Following | None, ...]  # how a stream that is not on the grid follows it
    rate: RateMessage | None
    """None: the injection rate is not published."""
    summary: OutputMessage
    status: OutputMessage
    known: tuple[KnownMessage, ...]
    """All messages of all databases, used or not."""
    overlooked: tuple[str, ...]
    """What is wrong with databases that were read leniently."""

    @property
    def received(self) -> tuple[MessageLayout, ...]:
        """Every message that something is read from, once."""
        return (*self.input_layouts, *(slow.layout for slow in self.slow if not slow.is_input))


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
    files = list(zip(bench.databases, bench.config.dbc, strict=True))
    databases = [load_database(path, entry.lenient) for path, entry in files]
    inputs, layouts = _map_inputs(bench, databases)
    slow = _map_slow(bench, databases, layouts)
    energizing = None
    if bench.config.signals.energizing is not None:
        message = _message(bench, databases, "signals.energizing", bench.config.signals.energizing.message)
        carrier = next(one for one in slow if one.layout.name == message.name)
        leading = next(row for row in inputs.timing if row["joining"] == Joining.INDEX)
        energizing = map_energizing(bench, message, carrier, leading)
    _say_nothing(inputs, slow, energizing)
    outputs = bench.config.outputs
    rate = None
    if outputs.injection_rate:
        rate = rate_message(_message(bench, databases, "outputs.injection_rate", outputs.injection_rate))
    return BusMap(
        inputs=inputs,
        input_layouts=layouts,
        slow=slow,
        energizing=energizing,
        following=tuple(following(bench, inputs.timing, inputs.streams["roles"].tolist())),
        rate=rate,
        summary=output_message(
            _message(bench, databases, "outputs.injection_summary", outputs.injection_summary),
            SUMMARY_SIGNALS,
        ),
        status=output_message(
            _message(bench, databases, "outputs.status", outputs.status),
            (*STATUS_SIGNALS, *ENERGIZING_STATUS_SIGNALS),
        ),
        known=tuple(
            KnownMessage(message.name, frame_key(message.frame_id, message.is_extended_frame), path)
            for (path, _), database in zip(files, databases, strict=True)
            for message in database.messages
        ),
        overlooked=tuple(
            f"{path}: {complaint}"
            for (path, entry), database in zip(files, databases, strict=True)
            if entry.lenient
            for complaint in overlooked(database)
        ),
    )


def _message(bench: Bench, databases: Sequence[Database], key: str, name: str) -> Message:
    for database in databases:
        if any(message.name == name for message in database.messages):
            return find_message(database, name)
    with _named(f"{bench.path}: {key}"):
        return find_message(databases[0], name)


def _map_inputs(bench: Bench, databases: Sequence[Database]) -> tuple[Inputs, tuple[MessageLayout, ...]]:
    by_message: dict[str, list[Role]] = {}
    for role in ROLES:
        by_message.setdefault(bench.config.signals.of(role).message, []).append(role)
    tables = InputTables()
    layouts = []
    streams = []
    for name, roles in by_message.items():
        message = _message(bench, databases, f"signals.{roles[0]}.message", name)
        layout = protected_layout(message)
        layouts.append(layout)
        row = _frame_row(layout)
        streams += [(message, together) for together in _map_message(bench, message, roles, row, tables)]
    timing = map_timing(bench, streams, tables.stream_samples)
    require_one_rate(bench, streams, timing["steps"].tolist())
    return tables.inputs(timing), tuple(layouts)


def _frame_row(layout: MessageLayout) -> NDArray[np.void]:
    """What tells whether a frame is a good one of this message; the rest is 0."""
    row = np.zeros((), INPUT_MESSAGE)
    row["key"] = frame_key(layout.frame_id, layout.is_extended)
    row["length"] = layout.length
    row["padded_length"] = can.util.dlc2len(can.util.len2dlc(layout.length))
    row["e2e_profile"] = layout.e2e_profile or UNPROTECTED
    row["data_id"] = layout.e2e_data_id or 0
    return row


def _map_slow(
    bench: Bench, databases: Sequence[Database], inputs: Sequence[MessageLayout]
) -> tuple[SlowMessage, ...]:
    by_message: dict[str, list[tuple[OptionalRole, SlowSignalConfig]]] = {}
    for role, config in bench.config.signals.optional:
        by_message.setdefault(config.message, []).append((role, config))
    energizing = bench.config.signals.energizing
    if energizing is not None:
        by_message.setdefault(energizing.message, [])
    slow = []
    for name, mappings in by_message.items():
        first = mappings[0][0] if mappings else "energizing"
        message = _message(bench, databases, f"signals.{first}.message", name)
        signals = []
        for role, config in mappings:
            with _named(f"{bench.path}: signals.{role}"):
                find_signal(message, config.signal)
            factor = 1.0
            if isinstance(config, SlowQuantityConfig):
                factor = _unit_factor(bench, role, message, config.signal, config.unit, MASS_UNITS)
            with _named(f"{bench.path}: signals.{role}"):
                signals.append(slow_signal(message, role, config.signal, factor))
        layout = protected_layout(message)
        slow.append(SlowMessage(layout, _frame_row(layout)[None], tuple(signals), layout in inputs))
    return tuple(slow)


def _say_nothing(inputs: Inputs, slow: Sequence[SlowMessage], energizing: Energizing | None) -> None:
    """Frames made of recordings, which have no optional inputs, must not tell any."""
    for message in slow:
        for row in inputs.messages[inputs.messages["key"] == message.frame[0]["key"]]:
            first = int(row["first_kind"])
            for kind in inputs.kinds[first : first + int(row["kind_count"])]:
                set_unknown(message, kind["blank"])
                if energizing is not None and energizing.layout == message.layout:
                    say_no_energizing(energizing, kind["blank"])


def _map_message(
    bench: Bench, message: Message, roles: Sequence[Role], row: NDArray[np.void], tables: InputTables
) -> list[list[Role]]:
    """Add a message to the tables; returns the roles of each of its streams."""
    samples: dict[Role, tuple[str, ...]] = {}
    streams: dict[tuple[SampleGroup, ...], list[Role]] = {}
    for role in roles:
        with _named(f"{bench.path}: signals.{role}"):
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
            with _named(f"{bench.path}: signals.{together[0]}"):
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


@contextmanager
def _named(place: str) -> Iterator[None]:
    """Errors that name message and signal also name the place in the bench file."""
    try:
        yield
    except UserError as error:
        raise UserError(place, f"{error.place} {error.problem}", error.remedy) from None


def _factor(bench: Bench, message: Message, role: Role, samples: Sequence[str]) -> float:
    return _unit_factor(bench, role, message, samples[0], bench.config.signals.of(role).unit, _UNITS[role])


def _unit_factor(
    bench: Bench,
    role: Role | OptionalRole,
    message: Message,
    signal: str,
    unit: str | None,
    units: Mapping[str, float],
) -> float:
    """To SI, of a signal whose unit the database states or, instead, the bench file as `unit`."""
    stated = unit or find_signal(message, signal).unit or ""
    if stated not in units:
        raise UserError(
            f"{bench.path}: signals.{role}",
            f"unit {stated!r} of {message.name} is not known" if stated else f"{message.name} states no unit",
            f'add unit = "..." with one of {", ".join(units)}',
        )
    return units[stated]
