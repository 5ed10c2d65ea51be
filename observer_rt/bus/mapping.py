"""From bench file and bus database to arrays: which frames carry which samples, which carry the results."""

from collections.abc import Sequence
from dataclasses import dataclass

import can.util
import numpy as np
from cantools.database.can import Database, Message
from numpy.typing import NDArray

from observer_rt.bus.database import MessageLayout, find_message, find_signal, load_database, signal_names
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
from observer_rt.bus.sample_groups import SampleGroup, sample_groups
from observer_rt.config import Bench, Role, SignalConfig
from observer_rt.errors import UserError
from observer_rt.units import LENGTH_UNITS, PRESSURE_UNITS

EXTENDED = 1 << 32  # added to the id of an extended frame, so that one number names a frame
INDEX_BITS = 32  # of the sample index in every input message
_UNITS = {
    Role.RAIL_PRESSURE: PRESSURE_UNITS,
    Role.NEEDLE_LIFT: LENGTH_UNITS,
    Role.LINE_PRESSURE: PRESSURE_UNITS,
}


def frame_key(frame_id: int, is_extended: bool) -> int:
    """One number for id and format of a frame."""
    return frame_id + (EXTENDED if is_extended else 0)


@dataclass(frozen=True)
class BusMap:
    """Everything the bench file says of the bus, compiled."""

    inputs: Inputs
    input_layouts: tuple[MessageLayout, ...]
    rate: RateMessage | None
    """None: the injection rate is not published."""
    summary: OutputMessage
    status: OutputMessage


def map_bus(bench: Bench) -> BusMap:
    """Compile the mapping of a bench file.

    Raises `UserError` naming bench file, key and what the database has instead.
    """
    databases = [load_database(path) for path in bench.databases]
    inputs, layouts = _map_inputs(bench, databases)
    outputs = bench.config.outputs
    rate = None
    if outputs.injection_rate:
        rate = rate_message(_message(bench, databases, "outputs.injection_rate", outputs.injection_rate))
    return BusMap(
        inputs=inputs,
        input_layouts=layouts,
        rate=rate,
        summary=output_message(
            _message(bench, databases, "outputs.injection_summary", outputs.injection_summary),
            SUMMARY_SIGNALS,
        ),
        status=output_message(_message(bench, databases, "outputs.status", outputs.status), STATUS_SIGNALS),
    )


def _message(bench: Bench, databases: Sequence[Database], key: str, name: str) -> Message:
    for database in databases:
        if any(message.name == name for message in database.messages):
            return find_message(database, name)
    try:
        return find_message(databases[0], name)
    except UserError as error:
        raise UserError(f"{bench.path}: {key}", f"{error.place} {error.problem}", error.remedy) from None


def _map_inputs(bench: Bench, databases: Sequence[Database]) -> tuple[Inputs, tuple[MessageLayout, ...]]:
    by_message: dict[str, list[Role]] = {}
    for role in ROLES:
        by_message.setdefault(bench.config.signals.of(role).message, []).append(role)
    tables = InputTables()
    layouts = []
    for name, roles in by_message.items():
        message = _message(bench, databases, f"signals.{roles[0]}.message", name)
        layout = protected_layout(message)
        layouts.append(layout)
        row = np.zeros((), INPUT_MESSAGE)
        row["key"] = frame_key(layout.frame_id, layout.is_extended)
        row["length"] = layout.length
        row["padded_length"] = can.util.dlc2len(can.util.len2dlc(layout.length))
        row["e2e_profile"] = layout.e2e_profile or UNPROTECTED
        row["data_id"] = layout.e2e_data_id or 0
        _map_message(bench, message, roles, row, tables)
    return tables.inputs(), tuple(layouts)


def _map_message(
    bench: Bench, message: Message, roles: Sequence[Role], row: NDArray[np.void], tables: InputTables
) -> None:
    samples: dict[Role, tuple[str, ...]] = {}
    streams: dict[tuple[str, tuple[SampleGroup, ...]], list[Role]] = {}
    for role in roles:
        config = bench.config.signals.of(role)
        samples[role] = _sample_names(bench, message, role, config)
        if row["samples"] not in (0, len(samples[role])):
            raise UserError(
                f"{bench.path}: signals.{role}",
                f"has {len(samples[role])} samples a frame, other signals of {message.name} have {row['samples']}",
                "name as many samples for every signal of a message",
            )
        row["samples"] = len(samples[role])
        index = _index_signal(bench, message, role)
        groups = _sample_groups(bench, message, role, samples[role], index)
        streams.setdefault((index, groups), []).append(role)
    for (index, groups), together in streams.items():
        for group in groups:
            group_row = np.zeros((), INPUT_GROUP)
            group_row["stream"] = tables.streams
            names = [index]
            for role in together:
                number = ROLES.index(role)
                group_row["roles"] |= 1 << number
                group_row["position"][number] = len(names)
                group_row["factor"][number] = _factor(bench, message, role, samples[role])
                names.extend(samples[role][group.offset : group.offset + group.count])
            tables.add_group(group_row, message, names, group)
        tables.streams += 1
    tables.add_message(row, message, [group for _, groups in streams for group in groups])


def _sample_names(bench: Bench, message: Message, role: Role, config: SignalConfig) -> tuple[str, ...]:
    try:
        return signal_names(message, config.names)
    except UserError as error:
        raise UserError(
            f"{bench.path}: signals.{role}", f"{error.place} {error.problem}", error.remedy
        ) from None


def _sample_groups(
    bench: Bench, message: Message, role: Role, samples: Sequence[str], index: str
) -> tuple[SampleGroup, ...]:
    try:
        return sample_groups(message, samples, index)
    except UserError as error:
        raise UserError(
            f"{bench.path}: signals.{role}", f"{error.place} {error.problem}", error.remedy
        ) from None


def _index_signal(bench: Bench, message: Message, role: Role) -> str:
    name = bench.config.signals.of(role).index
    if not any(signal.name == name for signal in message.signals):
        raise UserError(
            f"{bench.path}: signals.{role}.index",
            f"message {message.name} has no signal {name!r} that carries its sample index",
            "name the signal with the index of the frame's first sample; messages without one cannot be used yet",
        )
    signal = find_signal(message, name)
    if (signal.length, signal.is_signed, signal.scale, signal.offset) != (INDEX_BITS, False, 1, 0):
        raise UserError(
            f"{bench.path}: signals.{role}.index",
            f"{name} of message {message.name} is no unsigned number of {INDEX_BITS} bits in steps of 1",
            "name such a signal; an index that wraps earlier cannot be told from a device that starts anew",
        )
    return name


def _factor(bench: Bench, message: Message, role: Role, samples: Sequence[str]) -> float:
    units = _UNITS[role]
    stated = bench.config.signals.of(role).unit or find_signal(message, samples[0]).unit or ""
    if stated not in units:
        raise UserError(
            f"{bench.path}: signals.{role}",
            f"unit {stated!r} of {message.name} is not known" if stated else f"{message.name} states no unit",
            f'add unit = "..." with one of {", ".join(units)}',
        )
    return units[stated]
