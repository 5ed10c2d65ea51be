"""Messages that stay away, cannot be used, or carry values that cannot be right, as notices: begun, and over."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import BusMap, RoleRange, role_range, role_resolution
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import IMPOSSIBLE
from observer_rt.daemon.input_monitoring.arrivals import SECOND, Arrivals, WatchedMessage, sources_of
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.injector import SIGNALS
from observer_rt.engine.words import Topic
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

REPORTED_AFTER = 2.0  # s without a frame, or with useless ones only, after which it is reported
_USELESS = 10  # frames
LOOKS = 5  # in a row that find the same, before it is reported
RAIL_LOOKS = 30  # of a rail pressure that does not change: it may be steady and coarse
LIFT_MOVED = 50 * MICROMETRE  # in which there is an injection
PRESSURE_MOVED = 5 * MEGAPASCAL  # of the line against the rail: the needle has opened
FEWEST = 100  # samples, of which a look makes anything

Samples = Mapping[Role, NDArray[np.float64]]
"""Samples of every role [SI, pressures to any zero], at the same times."""


@dataclass
class _Use:
    """Progress of a message's samples, with how many of its frames, and when that was last new."""

    progress: tuple[int, ...]
    frames: int
    since: int
    is_reported: bool = False


class SilenceWatch:
    """Looks at the arrivals now and then."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._silent: dict[WatchedMessage, int] = {}  # reported, and when their last frame came
        self._together: set[WatchedMessage] = set()  # reported as all inputs, of these
        self._back_at = 0  # when the first of these came again
        self._uses = {source: _Use((), 0, 0) for source in arrivals.sources if source.streams}

    def look(self, now: int, progress: list[int], refused: Collection[WatchedMessage] = ()) -> list[Notice]:
        """Notices at a time [ns]; progress: the sample index every stream got to, as `alignment.memory.progress`.

        refused: messages whose frames cannot be used for a reason reported elsewhere.
        """
        findings = [*self._back(now), *self._silences(now), *self._useless(now, progress, refused)]
        return [Notice(Topic.INPUT, text, is_over) for text, is_over in findings]

    def _silences(self, now: int) -> Iterator[tuple[str, bool]]:
        arrivals = self._arrivals
        new = [
            source
            for source in arrivals.sources
            if source not in self._silent
            and arrivals.silence(source, now) > max(REPORTED_AFTER, source.patience)
        ]
        # What is still away is so by itself.
        if self._back_at and now - self._back_at > REPORTED_AFTER * SECOND:
            new += [source for source in arrivals.sources if source in self._together]
            self._together.clear()
            self._back_at = 0
        for source in new:
            self._silent[source] = arrivals.count_of(source).last
        for source in filter(arrivals.has_twin, new):
            wrong, right = (11, 29) if source.layout.is_extended else (29, 11)
            yield (
                f"{source.text}: its frames come with an identifier of {wrong} bits, the database says {right}\n"
                "  remedy: correct the identifier in the database, or in the device that sends it",
                False,
            )
        new = [source for source in new if not arrivals.has_twin(source)]
        sampled = [source for source in arrivals.sources if source.streams]
        if new and all(source in self._silent for source in sampled):
            self._together = {source for source in sampled if source in new}
            names = ", ".join(source.text for source in new)
            shortest = min(arrivals.silence(source, now) for source in new)
            yield (
                f"no frame of any input for {shortest:.1f} s: {names}\n"
                "  remedy: check that the measuring devices are on, the cable, and the bit rate",
                False,
            )
            return
        for source in new:
            silence = arrivals.silence(source, now)
            has_come = arrivals.count_of(source).frames > 0
            since = f"for {silence:.1f} s" if has_come else f"since the start {silence:.1f} s ago"
            yield (
                f"{source.text}: no frame {since}\n"
                "  remedy: check the device that sends it, its cable and identifier; other inputs come",
                False,
            )

    def _back(self, now: int) -> Iterator[tuple[str, bool]]:
        for source, last in list(self._silent.items()):
            newest = self._arrivals.count_of(source).last
            if newest <= last:
                continue
            since = f"again after {(newest - last) / SECOND:.1f} s" if last else "now"
            yield f"{source.text}: comes {since}", True
            del self._silent[source]
            if source in self._together:
                self._together.discard(source)
                self._back_at = self._back_at or now

    def _useless(
        self, now: int, progress: list[int], refused: Collection[WatchedMessage]
    ) -> Iterator[tuple[str, bool]]:
        for source, use in self._uses.items():
            got = tuple(progress[stream] for stream in source.streams)
            frames = self._arrivals.count_of(source).frames
            if got != use.progress or frames == use.frames or source in refused:
                if use.is_reported and got != use.progress:
                    yield f"{source.text}: its frames can be used again", True
                self._uses[source] = _Use(got, frames, now, use.is_reported and got == use.progress)
            elif (
                not use.is_reported
                and frames - use.frames > _USELESS
                and now - use.since > REPORTED_AFTER * SECOND
            ):
                use.is_reported = True
                yield (
                    f"{source.text}: {frames - use.frames} frames came, and none could be used\n  remedy: compare "
                    "its length, E2EProfile and E2EDataId with the database; is its index or counter stuck?",
                    False,
                )


@dataclass
class _WatchedRole:
    """One role: limits, and what the last looks found."""

    role: Role
    source: WatchedMessage
    limits: RoleRange
    step: float
    noise: float
    reading: str = ""  # what is odd about its last value
    looks: int = 0  # that found so
    reported: str = ""
    held: float = np.nan  # value that it had in all of the last looks
    constant: int = 0  # looks in a row
    moved: int = 0  # of these, after the first, in which another input moved
    frozen: bool = False

    def notice(self, what: str, is_over: bool = False) -> Notice:
        """Notice about the message."""
        return Notice(Topic.VALUE, f"{self.source.text}: {self.role} {what}", is_over)


class ValueWatch:
    """Looks some ten times a second at the newest values, and at the samples since it looked last."""

    def __init__(self, bus: BusMap, noise: NoiseLevels) -> None:
        sources = {role: source for source in sources_of(bus) for role in source.roles}
        self._watched = []
        for role in ROLES:
            limits = role_range(bus, role)
            step = role_resolution(bus, role, limits.highest)
            self._watched.append(
                _WatchedRole(role, sources[role.value], limits, step, getattr(noise, role.value))
            )

    def look(self, newest: NDArray[np.float64], samples: Samples) -> list[Notice]:
        """Notices; newest (3,) [SI]: last value received of every role, whether it could be used or not.

        Without a value in it is only what has none while there are no samples: the last frame of a window may be
        filled up with `not available`.
        """
        has_samples = len(samples[Role.LINE_PRESSURE]) > 0
        notices: list[Notice] = []
        for watched, value in zip(self._watched, newest.tolist(), strict=True):
            is_filled_up = has_samples and np.isnan(value)
            notices += self._reading(watched, "" if is_filled_up else _oddity(watched, value))
        if all(len(values) >= FEWEST for values in samples.values()):
            notices += self._constancy(samples)
        return notices

    def _reading(self, watched: _WatchedRole, reading: str) -> Iterator[Notice]:
        watched.looks = watched.looks + 1 if reading == watched.reading else 1
        watched.reading = reading
        if watched.looks >= LOOKS and reading != watched.reported:
            watched.reported = reading
            remedy = "check the sensor, its cable and amplifier; unit and range in the database"
            yield watched.notice(
                f"{reading}\n  remedy: {remedy}" if reading else "has values again", not reading
            )

    def _constancy(self, samples: Samples) -> Iterator[Notice]:
        lift_moves = bool(np.ptp(samples[Role.NEEDLE_LIFT]) > LIFT_MOVED)
        across = samples[Role.LINE_PRESSURE] - samples[Role.RAIL_PRESSURE]
        pressure_moves = bool(np.ptp(across) > PRESSURE_MOVED)
        for watched in self._watched:
            values = samples[watched.role]
            first = float(values[0])
            if np.ptp(values) > 0.0 or (watched.constant and first != watched.held):
                if watched.frozen:
                    yield watched.notice("moves again", is_over=True)
                watched.constant, watched.moved, watched.frozen = 0, 0, False
                continue
            watched.held = first
            watched.constant += 1
            # not in the first look: the line still swings when the needle has just shut
            moves = pressure_moves if watched.role is Role.NEEDLE_LIFT else lift_moves
            watched.moved += moves and watched.constant > 1
            if not watched.frozen and not watched.reading and _is_frozen(watched):
                watched.frozen = True
                other = "line pressure moves" if watched.role is Role.NEEDLE_LIFT else "needle opens"
                yield watched.notice(
                    f"is frozen: the same value all the time while the {other}\n"
                    "  remedy: check the sensor, its cable and amplifier, and the device that sends it"
                )


def _is_frozen(watched: _WatchedRole) -> bool:
    if watched.role is not Role.RAIL_PRESSURE:
        return watched.moved >= 1
    return watched.constant >= RAIL_LOOKS and watched.moved >= 3 and watched.noise >= watched.step


def _oddity(watched: _WatchedRole, value: float) -> str:
    """Fault of a value in words; empty: none."""
    _, unit, size = SIGNALS[watched.role]
    limits, half = watched.limits, watched.step / 2
    if np.isnan(value):
        return "says `not available` or `error`"
    if not abs(value) < IMPOSSIBLE[ROLES.index(watched.role)]:
        return f"is impossible: {value / size:.3g} {unit}"
    if value >= limits.highest - half:
        return f"is at the upper end of its range, {limits.highest / size:.6g} {unit}"
    # a lift at rest may be clamped to 0
    if value <= limits.lowest + half and (watched.role is not Role.NEEDLE_LIFT or limits.lowest < 0.0):
        return f"is at the lower end of its range, {limits.lowest / size:.6g} {unit}"
    return ""
