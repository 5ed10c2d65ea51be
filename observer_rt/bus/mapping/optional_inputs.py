"""Optional inputs, from bench file and bus database: which frames carry them, and how."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.database.catalogue import BenchDatabases, BusMessage, named
from observer_rt.bus.database.codec import encode, signal_table
from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.database.lookup import MessageLayout, find_signal
from observer_rt.bus.database.multiplexing import Selection, compile_conditions, conditions_of, is_selected
from observer_rt.bus.database.signal_unit import from_unit, stated_unit, unknown_unit
from observer_rt.bus.mapping.energizing import EnergizingLayout, map_energizing
from observer_rt.bus.mapping.input_tables import (
    ENERGIZING,
    OPTIONAL_INPUT,
    OPTIONAL_ROLES,
    Inputs,
    InputTables,
)
from observer_rt.bus.mapping.output_messages import protected_layout
from observer_rt.bus.mapping.timing import Joining
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import (
    FuelTemperatureConfig,
    LearningEnableConfig,
    OptionalRole,
    SlowQuantityConfig,
    SlowSignalConfig,
)
from observer_rt.foundation.units import MASS_UNITS, MILLISECOND, TEMPERATURE_ORIGINS

CYCLES = 10  # of a message, after which its last value is too old
SHORTEST_TIMEOUT = 1.0  # s, unless the bench file asks for less

_Mappings = list[tuple[OptionalRole, SlowSignalConfig]]


@dataclass(frozen=True, eq=False)
class SlowSignal:
    """The signal of an optional role."""

    role: OptionalRole
    name: str
    table: NDArray[np.void]
    """One row, `codec.SIGNAL`."""
    selection: Selection
    """What a multiplexed frame must hold to carry it."""
    factor: float
    """To SI."""
    origin: float
    """What its 0 is in SI."""
    timeout: float
    """After which a value counts no longer [s]."""
    untold: float
    """What frames made of a recording say [SI], nan: not available."""

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value [SI] the signal can have."""
        row = self.table[0]
        limits = [
            float(row[name] * row["scale"] + row["offset"]) * self.factor + self.origin
            for name in ("lowest", "highest")
        ]
        return min(limits), max(limits)


@dataclass(frozen=True, eq=False)
class SlowMessage:
    """A message with optional inputs."""

    layout: MessageLayout
    signals: tuple[SlowSignal, ...]
    energizing: EnergizingLayout | None


def slow_timeout(configured_ms: float | None, cycle_time_ns: int | None) -> float:
    """After which a value counts no longer [s]: as configured, else ten cycles of its message, else never."""
    if configured_ms is not None:
        return configured_ms * MILLISECOND
    return math.inf if cycle_time_ns is None else max(CYCLES * cycle_time_ns * 1e-9, SHORTEST_TIMEOUT)


def map_optional(
    fitted: BenchInjector,
    databases: BenchDatabases,
    tables: InputTables,
    timing: NDArray[np.void],
) -> tuple[SlowMessage, ...]:
    """Add the optional inputs to the tables: the messages that carry them; timing: of all streams.

    Raises `UserError` naming bench file and key.
    """
    by_message: dict[tuple[str, int], tuple[BusMessage, _Mappings]] = {}
    for role, config in fitted.config.signals.optional:
        found = databases.find(fitted.place(f"signals.{role}.message"), config.message, config.link)
        by_message.setdefault((config.message, found.bus), (found, []))[1].append((role, config))
    pulses, carrier = fitted.config.signals.energizing, None
    if pulses is not None:
        carrier = databases.find(fitted.place("signals.energizing.message"), pulses.message, pulses.link)
        by_message.setdefault((pulses.message, carrier.bus), (carrier, []))
    leading = next(row for row in timing if row["joining"] == Joining.INDEX)
    slow = []
    for found, roles in by_message.values():
        layout = protected_layout(*found)
        signals = tuple(_slow_signal(fitted, found.message, layout, role, config) for role, config in roles)
        energizing = None
        if found == carrier:
            energizing = map_energizing(fitted, databases.links[found.bus], found.message, layout, leading)
        slow.append(SlowMessage(layout, signals, energizing))
        tables.add_optional(layout, _rows(slow[-1]))
    return tuple(slow)


def _rows(message: SlowMessage) -> list[tuple[NDArray[np.void], NDArray[np.void], Selection]]:
    rows = []
    for signal in message.signals:
        row = np.zeros((), OPTIONAL_INPUT)
        row["role"], row["timeout"] = OPTIONAL_ROLES.index(signal.role), signal.timeout
        row["factor"], row["origin"] = signal.factor, signal.origin
        rows.append((row, signal.table, signal.selection))
    if (told := message.energizing) is not None:
        row = np.zeros((), OPTIONAL_INPUT)
        row["role"], row["is_placed"], row["factor"] = ENERGIZING, told.index is not None, told.factor or 1.0
        rows.append((row, told.table, told.selection))
    return rows


def _slow_signal(
    fitted: BenchInjector,
    message: Message,
    layout: MessageLayout,
    role: OptionalRole,
    config: SlowSignalConfig,
) -> SlowSignal:
    place = fitted.place(f"signals.{role}")
    with named(place):
        find_signal(message, config.signal)
    factor, origin, untold, timeout = 1.0, 0.0, math.nan, math.inf
    if isinstance(config, FuelTemperatureConfig):
        unit = stated_unit(message, config.signal, config.unit)
        if unit not in TEMPERATURE_ORIGINS:
            raise unknown_unit(place, message, unit, TEMPERATURE_ORIGINS)
        origin = TEMPERATURE_ORIGINS[unit]
        untold = fitted.parameters.fluid.reference_temperature or math.nan
    elif isinstance(config, SlowQuantityConfig):
        factor = from_unit(place, message, config.signal, config.unit, MASS_UNITS)
    with named(place):
        selection = compile_conditions(message, conditions_of(message, config.signal))
        table = signal_table(message, [config.signal])
    if isinstance(config, LearningEnableConfig) and not table[0]["has_not_available"]:
        untold = 1.0  # a frame made of a recording must not switch learning off
    if isinstance(config, FuelTemperatureConfig | LearningEnableConfig):
        timeout = slow_timeout(config.timeout_ms, layout.cycle_time_ns)
    return SlowSignal(role, config.signal, table, selection, factor, origin, timeout, untold)


def say_nothing(inputs: Inputs, slow: Sequence[SlowMessage]) -> None:
    """Have frames made of recordings tell no more of the optional inputs than a recording knows: no energizing."""
    for message in slow:
        layout = message.layout
        key = frame_key(layout.frame_id, layout.is_extended, layout.bus)
        for row in inputs.messages[inputs.messages["key"] == key]:
            first = int(row["first_kind"])
            for blank in inputs.kinds["blank"][first : first + int(row["kind_count"])]:
                for signal in message.signals:
                    untold = (signal.untold - signal.origin) / signal.factor
                    _write(np.array([untold]), signal.table, signal.selection, blank)
                if (told := message.energizing) is not None:
                    nothing = np.full(len(told.names), np.nan)
                    _write(nothing, told.table[-len(nothing) :], told.selection, blank)


def _write(
    values: NDArray[np.float64], table: NDArray[np.void], selection: Selection, payload: NDArray[np.uint8]
) -> None:
    """Values of signals into a frame without protection, if it carries them."""
    if is_selected(payload, selection, 0, len(selection.conditions)):
        encode(values, table, payload)
