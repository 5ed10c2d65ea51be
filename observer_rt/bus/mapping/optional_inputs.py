"""Optional inputs, from bench file and bus database: the frames and signals that carry them.

Energizing is a level, 0 while off, one or several samples a frame; or a duration, one a frame, 0 without.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message

from observer_rt.bus.database import lookup
from observer_rt.bus.database.catalogue import BenchDatabases, BusMessage, locating
from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.multiplexing import compile_conditions, conditions_of
from observer_rt.bus.mapping import input_tables
from observer_rt.bus.mapping.output_messages import protected_layout
from observer_rt.bus.mapping.timing import index_signal, time_on_bus
from observer_rt.config.bench import BenchInjector
from observer_rt.config.bench_file import LinkConfig
from observer_rt.config.signals import (
    OPTIONAL_SIGNALS,
    EnergizingConfig,
    OptionalRole,
    Role,
    SignalConfig,
    SlowSignalConfig,
)
from observer_rt.core.frames.frames import OPTIONAL_INPUT, Joining, Numbering, carries, encode_signals
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROSECOND, MILLISECOND, NANOSECONDS, TIME_UNITS, Floats, Structs, factor_of
from observer_rt.model.surroundings import Surroundings

NO_UNITS = ("", "-", "1")  # of a level
CYCLES = 10  # of a message, after which its last value is too old
SHORTEST_TIMEOUT = 1.0  # s, unless the bench file asks for less


@dataclass(frozen=True, eq=False)
class SlowSignal(input_tables.OptionalInput):
    """The signal of an optional role."""

    role: OptionalRole

    @property
    def name(self) -> str:
        """Name of the signal."""
        return self.names[0]

    @property
    def timeout(self) -> float:
        """Time for which a value counts [s]."""
        return float(self.row["timeout"])

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest value [SI] the signal can have."""
        signal = self.table[0]
        limits = [
            float((signal[name] * signal["scale"] + signal["offset"]) * self.row["factor"] + self.row["origin"])
            for name in ("lowest", "highest")
        ]
        return min(limits), max(limits)


@dataclass(frozen=True, eq=False)
class EnergizingLayout(input_tables.OptionalInput):
    """Layout of the energizing on the bus, compiled: one signal, or the samples of a level."""

    layout: lookup.MessageLayout
    index: str | None
    """The signal with the index of the frame's first sample; None: frames are placed by their stamps."""
    is_level: bool
    """Whether the signals are levels; else a duration."""
    delay: float
    """Time from a frame's last sample to its stamp [s]."""
    cycle: float | None
    """Time from frame to frame [s], None: it is sent on an event."""
    window: float
    """Time from the start of energizing within which the needle opens [s]."""

    @property
    def tells_samples(self) -> bool:
        """Whether start and end of the energizing are known to the sample, unlike those of a level sent seldom."""
        return self.index is not None and (not self.is_level or len(self.names) > 1 or self.cycle is None)

    def reading(self, values: Floats, stamp: int, follows: bool) -> "EnergizingSignal":
        """Reading of a frame received at `stamp` [ns]; values: by the table, SI; follows: see `EnergizingSignal`."""
        return EnergizingSignal(
            None if self.index is None else int(values[0]),
            stamp - round(self.delay * NANOSECONDS),
            values[-len(self.names) :],
            None if self.layout.e2e_profile is None else follows,
        )


class EnergizingSignal(NamedTuple):
    """Reading of the energizing from one frame, sample by sample."""

    first: int | None
    """Index of its first sample, modulo 2^32; None: the message has none."""
    taken: int
    """Time at which its last sample was taken, by the clock of the stamps [ns]."""
    values: Floats
    """(samples,) levels, or the duration [s]; nan: not available."""
    follows: bool | None
    """Whether no frame was lost since the reading before, by the E2E protection; None: without protection."""


class SlowMessage(NamedTuple):
    """A message with optional inputs."""

    layout: lookup.MessageLayout
    signals: tuple[SlowSignal, ...]
    energizing: EnergizingLayout | None

    @property
    def inputs(self) -> tuple[input_tables.OptionalInput, ...]:
        """Inputs of the message: the optional ones, and the energizing."""
        return self.signals if self.energizing is None else (*self.signals, self.energizing)


def map_optional(
    injector: BenchInjector, databases: BenchDatabases, tables: input_tables.InputTables, timing: Structs
) -> tuple[SlowMessage, ...]:
    """Adds optional inputs to the tables; returns their messages. Raises `UserError` naming bench file and key."""
    by_message: dict[tuple[str, int], tuple[BusMessage, list[tuple[OptionalRole, SlowSignalConfig]]]] = {}
    for role, config in injector.config.signals.optional:
        source = databases.find(injector.location(f"signals.{role}.message"), config.message, config.link)
        by_message.setdefault((config.message, source.bus), (source, []))[1].append((role, config))
    pulses, carrier = injector.config.signals.energizing, None
    if pulses is not None:
        carrier = databases.find(injector.location("signals.energizing.message"), pulses.message, pulses.link)
        by_message.setdefault((pulses.message, carrier.bus), (carrier, []))
    leading = next(row for row in timing if row["joining"] == Joining.INDEX)
    slow = []
    for source, roles in by_message.values():
        layout = protected_layout(*source)
        signals = tuple(_slow_signal(injector, source.message, layout, role, config) for role, config in roles)
        energizing = None
        if pulses is not None and source == carrier:
            energizing = _energizing(injector, pulses, databases.links[source.bus], source.message, layout, leading)
            if injector.config.signals.needle_lift is None and not energizing.tells_samples:
                raise UserError(
                    injector.location("signals.energizing"),
                    "does not tell to a sample when the injector is energized, and no needle lift is measured",
                    "name its index, of the line pressure's time base; or measure the lift, [signals.needle_lift]",
                )
        slow.append(SlowMessage(layout, signals, energizing))
        tables.add_optional(layout, slow[-1].inputs)
    return tuple(slow)


def _slow_signal(
    injector: BenchInjector,
    message: Message,
    layout: lookup.MessageLayout,
    role: OptionalRole,
    config: SlowSignalConfig,
) -> SlowSignal:
    location = injector.location(f"signals.{role}")
    with locating(location):
        lookup.find_signal(message, config.signal)
    carried, own_unit = OPTIONAL_SIGNALS[role], getattr(config, "unit", None)
    unit, factor, timeout = lookup.stated_unit(message, config.signal, own_unit), 1.0, math.inf
    if carried.origins is not None and unit not in carried.origins:
        raise lookup.unknown_unit(location, message, unit, own_unit, carried.origins)
    if carried.units is not None:
        factor = lookup.from_unit(location, message, config.signal, own_unit, carried.units)
    origin = carried.to_si(unit)[1]
    with locating(location):
        selection = compile_conditions(message, conditions_of(message, config.signal))
        table = signal_table(message, [config.signal])
    default = (carried.usual(injector.parameters) - origin) / factor
    if not carried.always and table[0]["has_not_available"]:
        default = math.nan
    if carried.expires:
        timeout = slow_timeout(getattr(config, "timeout_ms", None), layout.cycle_time_ns)
    row = np.zeros((), OPTIONAL_INPUT)
    row["role"], row["timeout"] = input_tables.OPTIONAL_ROLES.index(role), timeout
    row["factor"], row["origin"] = factor, origin
    row["lowest"], row["highest"] = carried.possible
    row["surrounding"] = Surroundings._fields.index(role) if role in Surroundings._fields else -1
    return SlowSignal((config.signal,), table, selection, row, default, role)


def slow_timeout(configured_ms: float | None, cycle_time_ns: int | None) -> float:
    """Time [s] for which a value counts: as configured, else ten cycles of its message, else without end."""
    if configured_ms is not None:
        return configured_ms * MILLISECOND
    return math.inf if cycle_time_ns is None else max(CYCLES * cycle_time_ns * 1e-9, SHORTEST_TIMEOUT)


def _energizing(
    injector: BenchInjector,
    config: EnergizingConfig,
    link: LinkConfig,
    message: Message,
    layout: lookup.MessageLayout,
    grid: np.void,
) -> EnergizingLayout:
    """Compile the mapping of the energizing; link: its bus; grid: row TIMING of the line pressure's message."""
    location = injector.location("signals.energizing")
    roles = map(injector.config.signals.of, Role)
    companions = [mapping for mapping in roles if mapping.message == message.name]  # roles that it carries too
    with locating(location):
        names = lookup.signal_names(message, config.names)
        groups = input_tables.sample_groups(message, names)
    index = _index(injector, config, message, companions, grid)
    if index is not None:
        with locating(location):
            input_tables.require_carried(message, index, groups)
    if len(groups) > 1:
        problem = f"comes in {len(groups)} kinds of frame of {message.name} that take turns"
        raise UserError(location, problem, "name samples that one frame carries")
    unit = lookup.stated_unit(message, names[0], config.unit)
    factor = None if unit in NO_UNITS else factor_of(unit, TIME_UNITS)
    if factor is None and unit not in NO_UNITS:
        remedy = f'add unit = "..." with one of {", ".join(TIME_UNITS)} for a duration, or "-" for a level'
        raise UserError(location, f"unit {unit!r} of {message.name} is neither a time nor that of a level", remedy)
    if factor is not None and len(names) > 1:
        problem = f"names {len(names)} durations a frame of {message.name}"
        raise UserError(location, problem, "name one; only levels may come as several samples")
    expected = len(lookup.signal_names(message, companions[0].names)) if companions else len(names)
    if len(names) not in (1, expected):
        problem = f"names {len(names)} levels a frame, {message.name} has {expected} samples of other signals"
        raise UserError(location, problem, "name as many, or one")
    cycle = layout.cycle_time_ns / NANOSECONDS if layout.cycle_time_ns else None
    if companions or len(names) > 1:
        cycle = expected / injector.sample_rate
    row = np.zeros((), OPTIONAL_INPUT)
    row["role"], row["is_placed"], row["factor"] = input_tables.ENERGIZING, index is not None, factor or 1.0
    row["surrounding"] = -1
    return EnergizingLayout(
        names=names,
        table=signal_table(message, names if index is None else (index, *names), index),
        selection=compile_conditions(message, groups[0].conditions),
        row=row,
        default=math.nan,
        layout=layout,
        index=index,
        is_level=factor is None,
        delay=time_on_bus(layout, link) if config.delay_us is None else config.delay_us * MICROSECOND,
        cycle=cycle,
        window=config.missing_after_ms * MILLISECOND,
    )


def _index(
    injector: BenchInjector,
    config: EnergizingConfig,
    message: Message,
    companions: Sequence[SignalConfig],
    grid: np.void,
) -> str | None:
    """The signal that places the frames on the grid, None where their stamps must."""
    line = injector.config.signals.of(Role.LINE_PRESSURE)
    on_grid = config.time_base == line.time_base and grid["numbering"] == Numbering.INDEX
    on_grid = on_grid and all(other.rate_hz in (None, injector.sample_rate) for other in companions)
    name = config.index
    if name is None and on_grid:
        usual = lookup.USUAL_INDEX if any(signal.name == lookup.USUAL_INDEX for signal in message.signals) else None
        name = next((other.index for other in companions if other.index is not None), usual)
    if not name:
        return None
    location = injector.location("signals.energizing.index")
    if not on_grid:
        problem = f"{name} of {message.name} is not the index that the line pressure is numbered by"
        raise UserError(location, problem, 'set index = "", so that its stamps place it')
    index_signal(location, message, name)
    return name


def fill_blank_frames(inputs: input_tables.Inputs, slow: Sequence[SlowMessage]) -> None:
    """Put the defaults of the optional inputs into the blank frames that recordings are encoded in."""
    for message in slow:
        for row in inputs.messages[inputs.messages["key"] == message.layout.key]:
            first = int(row["first_kind"])
            for blank in inputs.kinds["blank"][first : first + int(row["kind_count"])]:
                for entry in message.inputs:
                    if carries(blank, entry.selection, 0, len(entry.selection.conditions)):
                        count = len(entry.names)
                        encode_signals(np.full(count, entry.default), entry.table[-count:], blank)
