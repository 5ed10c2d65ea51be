"""From bench file and bus database to arrays: which frames carry which samples, which carry the results."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import can.util
import numpy as np
from cantools.database.can import Database, Message
from numpy.typing import NDArray

from observer_rt.bus.codec import signal_table
from observer_rt.bus.database import MessageLayout, find_message, find_signal, load_database, signal_names
from observer_rt.bus.timing import Following, following, map_timing, number_signal
from observer_rt.config import Bench, Role, SignalConfig
from observer_rt.errors import UserError
from observer_rt.units import LENGTH_UNITS, PRESSURE_UNITS

EXTENDED = 1 << 32  # added to the id of an extended frame, so that one number names a frame
E2E_PROFILE = 5
ROLES = tuple(Role)
MAX_INPUTS = len(ROLES)
_UNITS = {
    Role.RAIL_PRESSURE: PRESSURE_UNITS,
    Role.NEEDLE_LIFT: LENGTH_UNITS,
    Role.LINE_PRESSURE: PRESSURE_UNITS,
}

INPUT_MESSAGE = np.dtype(
    [
        ("key", np.int64),
        ("length", np.int64),  # bytes, by the database
        ("padded_length", np.int64),  # bytes, as CAN FD carries a message of this length
        ("data_id", np.int64),  # of E2E, -1 for an unprotected message
        ("samples", np.int64),  # of every role, in one frame
        ("roles", np.int64),  # bit r: carries ROLES[r]
        ("position", np.int64, (MAX_INPUTS,)),  # of a role's first sample among the decoded values
        ("factor", np.float64, (MAX_INPUTS,)),  # to SI
        ("first_signal", np.int64),  # rows of the signal table: index or counter, if any, then the samples
        ("signal_count", np.int64),
    ],
    align=True,
)


def frame_key(frame_id: int, is_extended: bool) -> int:
    """One number for id and format of a frame."""
    return frame_id + (EXTENDED if is_extended else 0)


class Inputs(NamedTuple):
    """What compiled code needs to decode the input frames."""

    messages: NDArray[np.void]  # INPUT_MESSAGE
    signals: NDArray[np.void]  # SIGNAL, of all messages one after another
    timing: NDArray[np.void]  # TIMING


@dataclass(frozen=True)
class OutputMessage:
    """A message the results go out in: `names` of the known signals present in it, and their table."""

    layout: MessageLayout
    names: tuple[str, ...]
    table: NDArray[np.void]


@dataclass(frozen=True)
class BusMap:
    """Everything the bench file says of the bus, compiled."""

    inputs: Inputs
    input_layouts: tuple[MessageLayout, ...]
    following: tuple[Following | None, ...]  # how a message that is not on the grid follows it
    rate: OutputMessage
    rate_samples: int
    summary: OutputMessage
    status: OutputMessage


HEADER_SIGNALS = ("SampleIndex", "Valid", "Learning", "State")
RATE_PATTERN = "InjectionRate_{:02d}"
SUMMARY_SIGNALS = (
    *HEADER_SIGNALS,
    "EndIndex",
    "InjectionNumber",
    "EventNumber",
    "PhiVersion",
    "InjectorId",
    "Reason",
    "Mass",
    "MassSigma",
    "Volume",
    "RailPressureAtStart",
    "PeakInjectionRate",
    "NozzleWear",
    "NozzleWearSigma",
    "SeatWear",
    "SeatWearSigma",
    "LinePressureOffset",
)
STATUS_SIGNALS = (
    *HEADER_SIGNALS,
    "Reason",
    "InjectorId",
    "VersionMajor",
    "VersionMinor",
    "VersionPatch",
    "ModelHash",
    "DatabaseHash",
    "SamplesProcessed",
    "LostSamples",
    "InterpolatedSamples",
    "CrcErrors",
    "SequenceErrors",
    "LengthErrors",
    "RepeatedFrames",
    "OldFrames",
    "DroppedFrames",
    "Restarts",
    "Adoptions",
    "RejectedAdoptions",
    "LateAdoptions",
)


def map_bus(bench: Bench) -> BusMap:
    """Compile the mapping of a bench file.

    Raises `UserError` naming bench file, key and what the database has instead.
    """
    databases = [load_database(path) for path in bench.databases]
    inputs, layouts = _map_inputs(bench, databases)
    outputs = bench.config.outputs
    rate_message = _message(bench, databases, "outputs.injection_rate", outputs.injection_rate)
    rates = signal_names(rate_message, RATE_PATTERN)
    return BusMap(
        inputs=inputs,
        input_layouts=layouts,
        following=tuple(following(bench, inputs.timing, inputs.messages["roles"].tolist())),
        rate=_output(rate_message, (*HEADER_SIGNALS, *rates)),
        rate_samples=len(rates),
        summary=_output(
            _message(bench, databases, "outputs.injection_summary", outputs.injection_summary),
            SUMMARY_SIGNALS,
        ),
        status=_output(_message(bench, databases, "outputs.status", outputs.status), STATUS_SIGNALS),
    )


def _message(bench: Bench, databases: Sequence[Database], key: str, name: str) -> Message:
    for database in databases:
        if any(message.name == name for message in database.messages):
            return find_message(database, name)
    try:
        return find_message(databases[0], name)
    except UserError as error:
        raise UserError(f"{bench.path}: {key}", f"{error.place} {error.problem}", error.remedy) from None


def _output(message: Message, known: Sequence[str]) -> OutputMessage:
    present = {signal.name for signal in message.signals}
    names = tuple(name for name in known if name in present)
    layout = MessageLayout.of(message)
    _require_known_profile(layout)
    return OutputMessage(layout, names, signal_table(message, names))


def _map_inputs(bench: Bench, databases: Sequence[Database]) -> tuple[Inputs, tuple[MessageLayout, ...]]:
    by_message: dict[str, list[Role]] = {}
    for role in ROLES:
        by_message.setdefault(bench.config.signals.of(role).message, []).append(role)
    rows = np.zeros(len(by_message), INPUT_MESSAGE)
    tables = []
    layouts = []
    messages = []
    first_signal = 0
    for row, (name, roles) in zip(rows, by_message.items(), strict=True):
        message = _message(bench, databases, f"signals.{roles[0]}.message", name)
        table = _map_message(bench, message, roles, row)
        row["first_signal"], row["signal_count"] = first_signal, len(table)
        first_signal += len(table)
        tables.append(table)
        layouts.append(MessageLayout.of(message))
        messages.append((message, roles))
    timing = map_timing(bench, messages, rows["samples"].tolist())
    return Inputs(rows, np.concatenate(tables), timing), tuple(layouts)


def _map_message(bench: Bench, message: Message, roles: Sequence[Role], row: np.void) -> NDArray[np.void]:
    layout = MessageLayout.of(message)
    _require_known_profile(layout)
    row["key"] = frame_key(layout.frame_id, layout.is_extended)
    row["length"] = layout.length
    row["padded_length"] = can.util.dlc2len(can.util.len2dlc(layout.length))
    row["data_id"] = -1 if layout.e2e_data_id is None else layout.e2e_data_id
    number = number_signal(bench, message, roles)
    names: list[str] = [] if number is None else [number.name]
    for role in roles:
        config = bench.config.signals.of(role)
        samples = _sample_names(bench, message, role, config)
        if row["samples"] not in (0, len(samples)):
            raise UserError(
                f"{bench.path}: signals.{role}",
                f"has {len(samples)} samples a frame, other signals of {message.name} have {row['samples']}",
                "name as many samples for every signal of a message",
            )
        place = ROLES.index(role)
        row["samples"] = len(samples)
        row["roles"] |= 1 << place
        row["position"][place] = len(names)
        row["factor"][place] = _factor(bench, message, role, samples)
        names.extend(samples)
    return signal_table(message, names)


def _sample_names(bench: Bench, message: Message, role: Role, config: SignalConfig) -> tuple[str, ...]:
    try:
        return signal_names(message, config.names)
    except UserError as error:
        raise UserError(
            f"{bench.path}: signals.{role}", f"{error.place} {error.problem}", error.remedy
        ) from None


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


def _require_known_profile(layout: MessageLayout) -> None:
    if layout.e2e_profile not in (None, E2E_PROFILE):
        raise UserError(
            f"message {layout.name}",
            f"is protected by E2E profile {layout.e2e_profile}",
            f"only profile {E2E_PROFILE} is supported",
        )
