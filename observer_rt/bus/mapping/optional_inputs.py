"""Optional inputs, from bench file and bus database: which frames carry them, and how.

The energizing of the injector on the bus: which signals tell it, and what a frame says of it.

Either a level, 0 while the injector is not energized, one or several samples a frame; or a duration, one value a
frame, 0 where there is none.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.database.catalogue import BenchDatabases, BusMessage, named
from observer_rt.bus.database.codec import encode, signal_table
from observer_rt.bus.database.lookup import (
    MessageLayout,
    find_signal,
    from_unit,
    signal_names,
    stated_unit,
    unknown_unit,
)
from observer_rt.bus.database.multiplexing import Selection, compile_conditions, conditions_of, is_selected
from observer_rt.bus.mapping.input_tables import (
    ENERGIZING,
    OPTIONAL_INPUT,
    OPTIONAL_ROLES,
    Inputs,
    InputTables,
    require_carried,
    sample_groups,
)
from observer_rt.bus.mapping.output_messages import protected_layout
from observer_rt.bus.mapping.timing import USUAL_INDEX, Joining, Numbering, index_signal, time_on_bus
from observer_rt.config.bench import BenchInjector
from observer_rt.config.links import LinkConfig
from observer_rt.config.signals import (
    EnergizingConfig,
    FuelTemperatureConfig,
    LearningEnableConfig,
    OptionalRole,
    Role,
    SignalConfig,
    SlowQuantityConfig,
    SlowSignalConfig,
)
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import (
    MASS_UNITS,
    MICROSECOND,
    MILLISECOND,
    TEMPERATURE_ORIGINS,
    TIME_UNITS,
    factor_of,
)

NO_UNITS = ("", "-", "1")  # of a level
NANOSECONDS = 1e9


@dataclass(frozen=True, eq=False)
class EnergizingLayout:
    """Where the energizing is on the bus, compiled."""

    layout: MessageLayout
    names: tuple[str, ...]
    """Its signals: one, or the samples of a level."""
    table: NDArray[np.void]
    """`codec.SIGNAL`: the index, where there is one, then its signals."""
    selection: Selection
    """What a multiplexed frame must hold to carry it."""
    index: str | None
    """The signal with the index of the frame's first sample; None: placed by its stamp."""
    factor: float | None
    """To seconds; None: a level."""
    delay: float
    """s from a frame's last sample to its stamp."""
    cycle: float | None
    """s from frame to frame, None: it is sent when there is something to say."""
    window: float
    """s from the start of energizing, within which the needle opens."""

    @property
    def is_level(self) -> bool:
        """Whether it is a level; else a duration."""
        return self.factor is None

    def reading(self, values: NDArray[np.float64], stamp: int, follows: bool) -> "EnergizingSignal":
        """What a frame received at `stamp` [ns] says; values: by the table, SI; follows: as of `EnergizingSignal`."""
        return EnergizingSignal(
            None if self.index is None else int(values[0]),
            stamp - round(self.delay * NANOSECONDS),
            values[-len(self.names) :],
            None if self.layout.e2e_profile is None else follows,
        )


class EnergizingSignal(NamedTuple):
    """What a frame says of the energizing, sample by sample."""

    first: int | None
    """Index of its first sample, modulo 2^32; None: the message has none."""
    taken: int
    """ns, by the clock of the stamps, when its last sample was taken."""
    values: NDArray[np.float64]
    """(samples,) levels, or the duration [s]; nan: not available."""
    follows: bool | None
    """Whether, by its protection, no frame was lost since the reading before; None: without one."""


def map_energizing(
    fitted: BenchInjector, link: LinkConfig, message: Message, layout: MessageLayout, grid: np.void
) -> EnergizingLayout:
    """Compile the mapping; link: its bus; grid: `timing.TIMING` of the line pressure's message.

    Raises `UserError` naming bench file and key.
    """
    place = fitted.place("signals.energizing")
    config = fitted.config.signals.energizing
    assert config is not None
    beside = _samples_beside(fitted, message)
    with named(place):
        names = signal_names(message, config.names)
        groups = sample_groups(message, names)
    index = _index(fitted, config, message, beside, grid)
    if index is not None:
        with named(place):
            require_carried(message, index, groups)
    if len(groups) > 1:
        problem = f"comes in {len(groups)} kinds of frame of {message.name} that take turns"
        raise UserError(place, problem, "name samples that one frame carries")
    factor = _factor(place, config, message, names)
    if factor is not None and len(names) > 1:
        problem = f"names {len(names)} durations a frame of {message.name}"
        raise UserError(place, problem, "name one; only levels may come as several samples")
    expected = len(signal_names(message, beside[0].names)) if beside else len(names)
    if len(names) not in (1, expected):
        problem = f"names {len(names)} levels a frame, {message.name} has {expected} samples of other signals"
        raise UserError(place, problem, "name as many, or one")
    delay = config.delay_us
    on_bus = time_on_bus(layout, link)
    return EnergizingLayout(
        layout=layout,
        names=names,
        table=signal_table(message, names if index is None else (index, *names)),
        selection=compile_conditions(message, groups[0].conditions),
        index=index,
        factor=factor,
        delay=on_bus if delay is None else delay * MICROSECOND,
        cycle=_cycle(fitted, layout, expected, bool(beside) or len(names) > 1),
        window=config.missing_after_ms * MILLISECOND,
    )


def _index(
    fitted: BenchInjector,
    config: EnergizingConfig,
    message: Message,
    beside: Sequence[SignalConfig],
    grid: np.void,
) -> str | None:
    """The signal that places the frames on the grid, None where their stamps must."""
    line = fitted.config.signals.of(Role.LINE_PRESSURE)
    on_grid = config.time_base == line.time_base and grid["numbering"] == Numbering.INDEX
    on_grid = on_grid and all(other.rate_hz in (None, fitted.config.sampling.rate_hz) for other in beside)
    name = config.index
    if name is None and on_grid:
        usual = USUAL_INDEX if any(signal.name == USUAL_INDEX for signal in message.signals) else None
        name = next((other.index for other in beside if other.index is not None), usual)
    if not name:
        return None
    place = fitted.place("signals.energizing.index")
    if not on_grid:
        problem = f"{name} of {message.name} is not the index that the line pressure is numbered by"
        raise UserError(place, problem, 'set index = "", so that its stamps place it')
    index_signal(place, message, name)
    return name


def _samples_beside(fitted: BenchInjector, message: Message) -> list[SignalConfig]:
    """The mappings of roles whose samples the message carries too."""
    mappings = (fitted.config.signals.of(role) for role in Role)
    return [mapping for mapping in mappings if mapping.message == message.name]


def _cycle(fitted: BenchInjector, layout: MessageLayout, samples: int, is_block: bool) -> float | None:
    """Time [s] from frame to frame, as far as the samples of one or the database tell it."""
    if is_block:
        return samples / fitted.config.sampling.rate_hz
    return layout.cycle_time_ns / NANOSECONDS if layout.cycle_time_ns else None


def _factor(place: str, config: EnergizingConfig, message: Message, names: tuple[str, ...]) -> float | None:
    stated = config.unit or find_signal(message, names[0]).unit or ""
    if stated in NO_UNITS:
        return None
    factor = factor_of(stated, TIME_UNITS)
    if factor is None:
        raise UserError(
            place,
            f"unit {stated!r} of {message.name} is neither a time nor that of a level",
            f'add unit = "..." with one of {", ".join(TIME_UNITS)} for a duration, or "-" for a level',
        )
    return factor


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
