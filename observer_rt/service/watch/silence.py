"""Messages that stay away, cannot be used, or carry values that cannot be right, as news: begun, and over."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.alignment import IMPOSSIBLE
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.signal_range import RoleRange, role_range, role_resolution
from observer_rt.config.signals import Role
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.service.watch.arrivals import SECOND, Arrivals, WatchedMessage, sources_of


@dataclass(frozen=True)
class WatchFinding:
    """What is wrong, with a remedy where there is one; `is_over`: it is well again."""

    text: str
    is_over: bool = False


TOLD = 2.0  # s without a frame, or with useless ones only, after which it is told
_USELESS = 10  # frames


@dataclass
class _Use:
    """How far a message's samples got, with how many of its frames, and when that was last new."""

    progress: tuple[int, ...]
    frames: int
    since: int
    is_told: bool = False


class SilenceWatch:
    """Looks at the arrivals now and then."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._silent: dict[WatchedMessage, int] = {}  # told, and when their last frame came
        self._together: set[WatchedMessage] = set()  # told as all inputs, of these
        self._back_at = 0  # when the first of these came again
        self._uses = {source: _Use((), 0, 0) for source in arrivals.sources if source.streams}

    def look(self, now: int, progress: list[int]) -> list[WatchFinding]:
        """News at a time [ns]; progress: the sample index every stream got to, as `alignment.memory.progress`."""
        return [*self._back(now), *self._silences(now), *self._useless(now, progress)]

    def _silences(self, now: int) -> list[WatchFinding]:
        arrivals = self._arrivals
        new = [
            source
            for source in arrivals.sources
            if source not in self._silent and arrivals.silence(source, now) > max(TOLD, source.patience)
        ]
        if self._back_at and now - self._back_at > TOLD * SECOND:  # what is still away is so by itself
            new += [source for source in arrivals.sources if source in self._together]
            self._together.clear()
            self._back_at = 0
        if not new:
            return []
        for source in new:
            self._silent[source] = arrivals.heard_of(source).last
        sampled = [source for source in arrivals.sources if source.streams]
        if all(source in self._silent for source in sampled):
            self._together = {source for source in sampled if source in new}
            names = ", ".join(source.text for source in new)
            shortest = min(arrivals.silence(source, now) for source in new)
            return [
                WatchFinding(
                    f"no frame of any input for {shortest:.1f} s: {names}\n"
                    "  remedy: check that the measuring devices are on, the cable, and the bit rate"
                )
            ]
        return [
            WatchFinding(
                f"{source.text}: no frame {self._since(source, now)}\n"
                "  remedy: check the device that sends it, its cable and identifier; other inputs come"
            )
            for source in new
        ]

    def _since(self, source: WatchedMessage, now: int) -> str:
        silence = self._arrivals.silence(source, now)
        if self._arrivals.heard_of(source).frames:
            return f"for {silence:.1f} s"
        return f"since the start {silence:.1f} s ago"

    def _back(self, now: int) -> list[WatchFinding]:
        over = []
        for source, last in list(self._silent.items()):
            if self._arrivals.heard_of(source).last > last:
                gone = (self._arrivals.heard_of(source).last - last) / SECOND
                text = f"comes again after {gone:.1f} s" if last else "comes now"
                over.append(WatchFinding(f"{source.text}: {text}", is_over=True))
                del self._silent[source]
                if source in self._together:
                    self._together.discard(source)
                    self._back_at = self._back_at or now
        return over

    def _useless(self, now: int, progress: list[int]) -> list[WatchFinding]:
        told = []
        for source, use in self._uses.items():
            got = tuple(progress[stream] for stream in source.streams)
            frames = self._arrivals.heard_of(source).frames
            if got != use.progress or frames == use.frames:
                if use.is_told and got != use.progress:
                    told.append(WatchFinding(f"{source.text}: its frames can be used again", is_over=True))
                self._uses[source] = _Use(got, frames, now, use.is_told and got == use.progress)
            elif not use.is_told and frames - use.frames > _USELESS and now - use.since > TOLD * SECOND:
                use.is_told = True
                told.append(
                    WatchFinding(
                        f"{source.text}: {frames - use.frames} frames came, and none could be used\n"
                        "  remedy: compare its length, E2EProfile and E2EDataId with the database; is its index or "
                        "counter stuck?"
                    )
                )
        return told


LOOKS = 5  # in a row that find the same, before it is told
RAIL_LOOKS = 30  # of a rail pressure that does not change: it may be steady and coarse
LIFT_MOVED = 50 * MICROMETRE  # in which there is an injection
PRESSURE_MOVED = 5 * MEGAPASCAL  # of the line against the rail: the needle has opened
FEWEST = 100  # samples, of which a look makes anything

Samples = Mapping[Role, NDArray[np.float64]]
"""Of every role [SI, pressures to any zero], at the same times."""
_UNITS = {
    Role.RAIL_PRESSURE: ("MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("um", MICROMETRE),
    Role.LINE_PRESSURE: ("MPa", MEGAPASCAL),
}


@dataclass
class _Watched:
    """One role: limits, and what the last looks found."""

    source: WatchedMessage
    limits: RoleRange
    step: float
    noise: float
    reading: str = ""  # what is odd about its last value
    looks: int = 0  # that found so
    told: str = ""
    held: float = np.nan  # value that it had in all of the last looks
    constant: int = 0  # looks in a row
    moved: int = 0  # of these, after the first, in which another input moved
    frozen: bool = False


class ValueWatch:
    """Looks some ten times a second at the newest values, and at the samples since it looked last."""

    def __init__(self, bus: BusMap, noise: NoiseLevels) -> None:
        sources = {role: source for source in sources_of(bus) for role in source.roles}
        self._roles: dict[Role, _Watched] = {}
        for role in ROLES:
            limits = role_range(bus, role)
            step = role_resolution(bus, role, limits.highest)
            self._roles[role] = _Watched(sources[role.value], limits, step, getattr(noise, role.value))

    def look(self, newest: NDArray[np.float64], samples: Samples) -> list[WatchFinding]:
        """News; newest (3,) [SI]: last value received of every role, whether it could be used or not.

        Without a value in it is only what has none while there are no samples: the last frame of a window may be
        filled up with `not available`.
        """
        told = []
        has_samples = len(samples[Role.LINE_PRESSURE]) > 0
        for (role, watched), value in zip(self._roles.items(), newest, strict=True):
            is_filled_up = has_samples and bool(np.isnan(value))
            told += self._reading(role, watched, "" if is_filled_up else _oddity(role, watched, float(value)))
        if all(len(values) >= FEWEST for values in samples.values()):
            told += self._constancy(samples)
        return told

    def _reading(self, role: Role, watched: _Watched, reading: str) -> list[WatchFinding]:
        watched.looks = watched.looks + 1 if reading == watched.reading else 1
        watched.reading = reading
        if watched.looks < LOOKS or reading == watched.told:
            return []
        watched.told = reading
        if not reading:
            return [WatchFinding(f"{watched.source.text}: {role} has values again", is_over=True)]
        return [
            WatchFinding(
                f"{watched.source.text}: {role} {reading}\n"
                "  remedy: check the sensor, its cable and amplifier; unit and range in the database"
            )
        ]

    def _constancy(self, samples: Samples) -> list[WatchFinding]:
        told = []
        lift_moves = bool(np.ptp(samples[Role.NEEDLE_LIFT]) > LIFT_MOVED)
        across = samples[Role.LINE_PRESSURE] - samples[Role.RAIL_PRESSURE]
        pressure_moves = bool(np.ptp(across) > PRESSURE_MOVED)
        for role, watched in self._roles.items():
            values = samples[role]
            first = float(values[0])
            if np.ptp(values) > 0.0 or (watched.constant and first != watched.held):
                if watched.frozen:
                    told.append(WatchFinding(f"{watched.source.text}: {role} moves again", is_over=True))
                watched.constant, watched.moved, watched.frozen = 0, 0, False
                continue
            watched.held = first
            watched.constant += 1
            # not in the first look: the line still swings when the needle has just shut
            moves = pressure_moves if role is Role.NEEDLE_LIFT else lift_moves
            watched.moved += moves and watched.constant > 1
            if not watched.frozen and not watched.reading and _is_frozen(role, watched):
                watched.frozen = True
                other = "line pressure moves" if role is Role.NEEDLE_LIFT else "needle opens"
                told.append(
                    WatchFinding(
                        f"{watched.source.text}: {role} is frozen: the same value all the time while the {other}\n"
                        "  remedy: check the sensor, its cable and amplifier, and the device that sends it"
                    )
                )
        return told


def _is_frozen(role: Role, watched: _Watched) -> bool:
    if role is not Role.RAIL_PRESSURE:
        return watched.moved >= 1
    return watched.constant >= RAIL_LOOKS and watched.moved >= 3 and watched.noise >= watched.step


def _oddity(role: Role, watched: _Watched, value: float) -> str:
    """What is wrong with a value; empty: nothing."""
    unit, factor = _UNITS[role]
    if np.isnan(value):
        return "says `not available` or `error`"
    if not abs(value) < IMPOSSIBLE[ROLES.index(role)]:
        return f"is impossible: {value / factor:.3g} {unit}"
    limits = watched.limits
    if value >= limits.highest - watched.step / 2:
        return f"is at the upper end of its range, {limits.highest / factor:.6g} {unit}"
    # a lift at rest may be clamped to 0
    if value <= limits.lowest + watched.step / 2 and (role is not Role.NEEDLE_LIFT or limits.lowest < 0.0):
        return f"is at the lower end of its range, {limits.lowest / factor:.6g} {unit}"
    return ""
