"""From bench file and bus database to the optional inputs: which frames carry them, and how."""

import math
from collections.abc import Sequence
from dataclasses import replace

from cantools.database.can import Message

from observer_rt.bus.database.catalogue import BenchDatabases, BusMessage, named
from observer_rt.bus.database.lookup import MessageLayout, find_signal
from observer_rt.bus.database.signal_unit import from_unit, stated_unit, unknown_unit
from observer_rt.bus.mapping.energizing import Energizing, map_energizing, say_no_energizing
from observer_rt.bus.mapping.input_tables import Inputs, frame_row
from observer_rt.bus.mapping.output_messages import protected_layout
from observer_rt.bus.mapping.slow_inputs import (
    SlowMessage,
    SlowSignal,
    say_nothing,
    slow_signal,
    slow_timeout,
)
from observer_rt.bus.mapping.timing import Joining
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import (
    FuelTemperatureConfig,
    LearningEnableConfig,
    OptionalRole,
    SlowQuantityConfig,
    SlowSignalConfig,
)
from observer_rt.foundation.units import MASS_UNITS, TEMPERATURE_ORIGINS

_Mappings = list[tuple[OptionalRole, SlowSignalConfig]]


def map_optional(
    fitted: BenchInjector, databases: BenchDatabases, inputs: Inputs, layouts: Sequence[MessageLayout]
) -> tuple[tuple[SlowMessage, ...], Energizing | None]:
    """The messages with optional inputs, and the energizing among them.

    layouts: of the messages that carry samples. The frames of `inputs` that are made of recordings are made to say
    nothing of what a recording does not know. Raises `UserError` naming bench file and key.
    """
    by_message: dict[tuple[str, int], tuple[BusMessage, _Mappings]] = {}
    for role, config in fitted.config.signals.optional:
        found = databases.find(fitted.place(f"signals.{role}.message"), config.message, config.link)
        by_message.setdefault((config.message, found.bus), (found, []))[1].append((role, config))
    pulses = fitted.config.signals.energizing
    if pulses is not None:
        carrier = databases.find(fitted.place("signals.energizing.message"), pulses.message, pulses.link)
        by_message.setdefault((pulses.message, carrier.bus), (carrier, []))
    by_key = {key: _slow_message(fitted, *mapped, layouts) for key, mapped in by_message.items()}
    slow = tuple(by_key.values())
    energizing = None
    if pulses is not None:
        leading = next(row for row in inputs.timing if row["joining"] == Joining.INDEX)
        sent_in = by_key[pulses.message, carrier.bus]
        energizing = map_energizing(fitted, databases.links[carrier.bus], carrier.message, sent_in, leading)
    _say_nothing(inputs, slow, energizing)
    return slow, energizing


def _slow_message(
    fitted: BenchInjector, found: BusMessage, roles: _Mappings, layouts: Sequence[MessageLayout]
) -> SlowMessage:
    layout = protected_layout(*found)
    signals = tuple(_slow_signal(fitted, found.message, layout, role, config) for role, config in roles)
    return SlowMessage(layout, frame_row(layout)[None], signals, layout in layouts)


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
        signal = slow_signal(message, role, config.signal, factor, origin)
    if isinstance(config, LearningEnableConfig) and not signal.has_not_available:
        untold = 1.0  # a frame made of a recording must not switch learning off
    if isinstance(config, FuelTemperatureConfig | LearningEnableConfig):
        timeout = slow_timeout(config.timeout_ms, layout.cycle_time_ns)
    return replace(signal, untold=untold, timeout=timeout)


def _say_nothing(inputs: Inputs, slow: Sequence[SlowMessage], energizing: Energizing | None) -> None:
    """Frames made of recordings tell no more of the optional inputs than a recording knows."""
    for message in slow:
        for row in inputs.messages[inputs.messages["key"] == message.frame[0]["key"]]:
            first = int(row["first_kind"])
            for kind in inputs.kinds[first : first + int(row["kind_count"])]:
                say_nothing(message, kind["blank"])
                if energizing is not None and energizing.layout == message.layout:
                    say_no_energizing(energizing, kind["blank"])
