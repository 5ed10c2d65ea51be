"""Timing of the samples of a message on the grid, as the bench file states it.

The grid is that of the message with the line pressure: its index, or the number of its frames. A message
with samples in other places has a relation to it, by which they are put between those of the grid.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from cantools.database.can import Message, Signal

from observer_rt.bus.can_frame import frame_time
from observer_rt.bus.database.lookup import INDEX_BITS, USUAL_INDEX, MessageLayout, find_signal
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import BenchInjector
from observer_rt.config.bench_file import LinkConfig
from observer_rt.config.injector_sections import Meaning
from observer_rt.config.signals import Role, undone_in_alignment
from observer_rt.core.frames import frames
from observer_rt.core.frames.frames import MAX_INTERPOLATED, Joining
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND, Structs

LONGEST_COUNTER = 16  # bits
HELD_CYCLES = 2.5  # of a slower signal, where the bench file states no max_hold_ms: one may be lost
LINE_SLOPE = 0.125 * MEGAPASCAL / MICROSECOND  # Pa/s, steepest of the line pressure when the needle opens
SHORTEST = 0.5  # of the time a frame takes on the bus
TOLERANCE = 2e-6  # s that the time of lift or line pressure may be unknown by: 0.25 MPa of the line pressure
RAIL_TOLERANCE = 20e-6  # s, the same of the rail pressure, which changes slowly
SLOW_TOLERANCE = 0.1  # of the interval of a slower one
RATIO_TOLERANCE = 1e-6
_LINE_PRESSURE = 1 << ROLES.index(Role.LINE_PRESSURE)


def map_timing(
    injector: BenchInjector,
    messages: Sequence[tuple[Message, Sequence[Role]]],
    links: Sequence[LinkConfig],
    samples: Sequence[int],
) -> Structs:
    """Rows TIMING of messages by their links, roles and samples a frame. Raises `UserError` naming file and key."""
    rows = np.zeros(len(messages), frames.TIMING)
    leading = next(n for n, (_, roles) in enumerate(messages) if Role.LINE_PRESSURE in roles)
    for row, (message, roles), link, size in zip(rows, messages, links, samples, strict=True):
        _map_message(injector, message, roles, link, size, row)
    grid = injector.config.signals.of(Role.LINE_PRESSURE)
    if rows[leading]["steps"] != 1:
        raise UserError(
            injector.location("signals.line_pressure.rate_hz"),
            "the line pressure is the signal all others are joined to and cannot be slower than sampling.rate_hz",
            "set sampling.rate_hz to the line pressure's rate",
        )
    for number, (row, (message, roles)) in enumerate(zip(rows, messages, strict=True)):
        same_base = _common_value(injector, message, roles, "time_base")[1] == grid.time_base
        both_indexed = row["numbering"] == rows[leading]["numbering"] == frames.Numbering.INDEX
        if number == leading or (same_base and both_indexed and row["steps"] == 1):
            row["joining"] = frames.Joining.INDEX
        elif same_base and both_indexed:
            row["joining"] = frames.Joining.RATIO
        else:
            row["joining"] = frames.Joining.NEAREST if same_base and row["steps"] == 1 else frames.Joining.CLOCK
    return rows


def number_signal(injector: BenchInjector, message: Message, roles: Sequence[Role]) -> Signal | None:
    """The signal that distinguishes the message's frames: its index, or the counter of one without; None: neither.

    Raises `UserError` naming bench file and key when the message has no such signal, or one that cannot serve.
    """
    index_location, index = _common_value(injector, message, roles, "index")
    location, counter = _common_value(injector, message, roles, "counter")
    names = {signal.name for signal in message.signals}
    if index is None and counter is None and USUAL_INDEX in names:
        index = USUAL_INDEX
    if index:
        if counter is not None:
            problem = f"message {message.name} has an index, {index}, which distinguishes its frames already"
            raise UserError(location, problem, "leave out 'counter', or set index = \"\"")
        return index_signal(index_location, message, index)
    if not counter:
        return None
    if counter not in names:
        raise UserError(location, f"message {message.name} has no signal {counter!r}", "name the one that counts")
    signal = find_signal(message, counter)
    if (signal.is_signed, signal.scale, signal.offset) != (False, 1, 0) or signal.length > LONGEST_COUNTER:
        kind = f"unsigned number of at most {LONGEST_COUNTER} bits in steps of 1"
        problem = f"{counter} of message {message.name} is no {kind}"
        raise UserError(location, problem, "name such a signal, which counts all its codes through")
    return signal


def index_signal(location: str, message: Message, name: str) -> Signal:
    """The signal `name`, sample index of a message. Raises `UserError` at `location` if missing or no index."""
    if not any(signal.name == name for signal in message.signals):
        raise UserError(
            location,
            f"message {message.name} has no signal {name!r} that carries its sample index",
            'name the signal with the index of the frame\'s first sample, or set index = "" for a message '
            "without one: its frames are then counted",
        )
    signal = find_signal(message, name)
    if (signal.length, signal.is_signed, signal.scale, signal.offset) != (INDEX_BITS, False, 1, 0):
        problem = f"{name} of message {message.name} is no unsigned number of {INDEX_BITS} bits in steps of 1"
        remedy = "name such a signal; one that wraps earlier can be named as 'counter' when it counts frames"
        raise UserError(location, problem, remedy)
    return signal


def _map_message(
    injector: BenchInjector, message: Message, roles: Sequence[Role], link: LinkConfig, samples: int, row: np.void
) -> None:
    layout = MessageLayout.of(message)
    signal = number_signal(injector, message, roles)
    numbering, modulus = frames.Numbering.STAMPS, 1
    if signal is not None and signal.length == INDEX_BITS:
        numbering = frames.Numbering.INDEX
    elif signal is not None:
        numbering, modulus = frames.Numbering.COUNTER, 1 << signal.length
    elif layout.e2e_data_id is not None:
        profile = layout.e2e_profile or frames.UNPROTECTED
        numbering, modulus = frames.Numbering.E2E_COUNTER, frames.values_of_counter(profile)
    row["numbering"], row["modulus"] = numbering, modulus
    row["steps"] = steps = _steps(injector, message, roles)
    row["interval"] = steps / injector.sample_rate
    row["tolerance"] = TOLERANCE
    if tuple(roles) == (Role.RAIL_PRESSURE,):
        row["tolerance"] = max(RAIL_TOLERANCE, SLOW_TOLERANCE * row["interval"])
    _, delay = _common_value(injector, message, roles, "delay_us")
    on_bus = time_on_bus(layout, link)
    row["delay"] = on_bus if delay is None else delay * MICROSECOND
    row["shortest"] = SHORTEST * on_bus
    _set_hold(injector, message, roles, samples, row)


def time_on_bus(layout: MessageLayout, link: LinkConfig) -> float:
    """Time [s] that a frame takes on the bus; 0 on a virtual bus."""
    if link.interface == "virtual" or link.channel.startswith("vcan"):
        return 0.0
    return frame_time(layout.length, layout.is_fd, link.bit_rate, link.data_bit_rate, layout.is_extended)


def _steps(injector: BenchInjector, message: Message, roles: Sequence[Role]) -> int:
    rate = injector.sample_rate
    location, stated = _common_value(injector, message, roles, "rate_hz")
    if stated is None:
        return 1
    ratio: float = rate / stated
    if ratio < 1.0 - RATIO_TOLERANCE or abs(ratio - round(ratio)) > RATIO_TOLERANCE * ratio:
        problem = f"{stated:g} Hz is no whole fraction of sampling.rate_hz = {rate:g}"
        raise UserError(location, problem, f"use {rate / max(1, round(ratio)):g}")
    if round(ratio) > 1 and tuple(roles) != (Role.RAIL_PRESSURE,):
        raise UserError(
            location,
            f"only a message with nothing but the rail pressure can be slower, {message.name} carries "
            f"{', '.join(roles)}",
            "needle lift and line pressure must be sampled at sampling.rate_hz",
        )
    return round(ratio)


def _set_hold(injector: BenchInjector, message: Message, roles: Sequence[Role], samples: int, row: np.void) -> None:
    location, stated = _common_value(injector, message, roles, "max_hold_ms")
    cycle = samples * float(row["interval"])
    if row["steps"] == 1:
        if stated is not None:
            problem = "is only for a signal slower than the others"
            raise UserError(location, problem, "leave it out, or state its rate_hz")
        return
    hold = HELD_CYCLES * cycle if stated is None else stated * MILLISECOND
    longest = frames.SLOTS // 2 / injector.sample_rate
    if not cycle <= hold:
        problem = f"is shorter than the {cycle / MILLISECOND:g} ms from frame to frame"
        raise UserError(location, problem, "make it longer than that")
    if hold > longest:
        raise UserError(
            location if stated is not None else _common_value(injector, message, roles, "rate_hz")[0],
            f"samples would have to wait {hold / MILLISECOND:g} ms for it, at most {longest / MILLISECOND:.3g} are "
            f"possible at {injector.sample_rate:g} Hz",
            "state a shorter max_hold_ms" if cycle <= longest else "a faster signal of the rail pressure is needed",
        )
    row["hold"] = hold


def _common_value(injector: BenchInjector, message: Message, roles: Sequence[Role], key: str) -> tuple[str, Any]:
    """Place in the bench file, and value, of a key that a message's roles have in common; None if none states it."""
    stated = {role: value for role in roles if (value := getattr(injector.config.signals.of(role), key)) is not None}
    first = next(iter(stated), roles[0])
    for role, value in stated.items():
        if value != stated[first]:
            problem = f"differs from that of signals.{first}, though message {message.name} carries both"
            remedy = "state it the same for all signals of a message"
            raise UserError(injector.location(f"signals.{role}.{key}"), problem, remedy)
    return injector.location(f"signals.{first}.{key}"), stated.get(first)


class GridRelation(NamedTuple):
    """Relation of a message's samples to the grid, by which they are put between its samples (`resampling.pxd`)."""

    roles: int
    """Bits, by `ROLES`, of the roles that are put there; the message's others stay where they are."""
    spacing: float
    """Samples of the grid from one sample of the message to its next."""
    reach: float
    """Longest distance of two of its samples that is bridged [samples of the grid]."""
    holds: bool
    """Whether its last sample is held for as long; else what follows is missing."""
    early: float = 0.0
    """How much its values are earlier than its samples [samples of the grid]."""
    on_grid: bool = False
    """Whether its samples are at places of the grid; else they lie between them."""


def grid_relations(injector: BenchInjector, timing: Structs, roles: list[int]) -> list[GridRelation | None]:
    """Relation of each message to the grid, None where all of it is on it; timing, roles (bits): of each message.

    The value of a mean is that of half a sample period earlier, a filtered value that of the stated delay earlier.
    The line pressure stays where it is: the model's is averaged and delayed instead.
    """
    config = injector.config
    rate = config.sampling.rate_hz
    result: list[GridRelation | None] = []
    for row, bits in zip(timing, roles, strict=True):
        others, spacing, is_slow = bits & ~_LINE_PRESSURE, float(row["steps"]), bool(row["steps"] > 1)
        reach = float(row["hold"]) * rate if is_slow else MAX_INTERPOLATED + 1.0
        delays = [undone_in_alignment(config.signals, role) for n, role in enumerate(ROLES) if others >> n & 1]
        early = max(delays, default=0.0) * rate + (0.5 * spacing if config.sampling.meaning is Meaning.MEAN else 0.0)
        if row["joining"] in (Joining.INDEX, Joining.NEAREST):
            follows = early != 0.0 and others != 0
            result.append(GridRelation(others, spacing, reach, False, early, True) if follows else None)
        else:
            result.append(GridRelation(bits, spacing, reach, is_slow, early))
    return result
