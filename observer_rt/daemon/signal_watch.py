"""Values that cannot be right, as notices with message and signal: when they begin, and when they are over."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.bus.alignment import LARGEST_DRIFT, MessageTiming
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.role_range import RoleRange, message_of, role_factor, role_range, role_resolution
from observer_rt.config.signals import Role, SignalsConfig
from observer_rt.core.frames.frames import IMPOSSIBLE
from observer_rt.core.stream.stream import FURTHEST_ZERO
from observer_rt.daemon.arrivals import WatchedMessage
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.noise import SIGNALS
from observer_rt.engine.signal_survey import OPEN, SignalSurvey, Survey, implausible, swapped, unshut
from observer_rt.engine.stream.standstill import LiftFigures
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.words import TOPICS, Topic
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, Floats

LOOKS = 5  # in a row that find something of a value, before it is reported
RAIL_LOOKS = 30  # of a rail pressure that does not change: it may be steady and coarse
LIFT_MOVED = 50 * MICROMETRE  # in which there is an injection
PRESSURE_MOVED = 5 * MEGAPASCAL  # of the line against the rail: the needle has opened
FEWEST = 100  # samples, of which a look makes anything
SURVEYED = 10  # looks whose values are judged together
SURVEYS = 2  # in a row that find the same, before it is reported
OUTSIDE_REMEDY = "correct the range in the database, or take all values: lenient = true in its [[dbc]]"
SWAPPED = "swapped"  # what is wrong with two signals together
LASTING = 20  # looks with another rate and a contradicted model before the rate is reported
MIN_FRAMES = 100  # whose stamps determine a rate
_FROZEN = "is frozen: the same value all the time while another input shows an injection"

Samples = Mapping[Role, Floats]
"""Samples of every role [SI, pressures to any zero], at the same times."""


class _Findings:
    """Faults by key; each is reported once enough looks in a row have found it, and again once they no longer do."""

    def __init__(self, looks: int, names: Mapping[str, str]) -> None:
        self._looks = looks
        self._names = names
        self._streaks: dict[str, int] = {}  # looks in a row that differ from the report
        self.reported: dict[str, str] = {}
        """Faults in force, in words with their remedy."""

    def look(self, faults: Mapping[str, str]) -> Iterator[Notice]:
        """Notices; faults: of this look, by their keys in `names`."""
        for key, name in self._names.items():
            is_found, is_reported = key in faults, key in self.reported
            self._streaks[key] = self._streaks.get(key, 0) + 1 if is_found != is_reported else 0
            if self._streaks[key] < self._looks:
                continue
            if is_found:
                self.reported[key] = f"{name} {faults[key]}"
                yield Notice(Topic.VALUE, self.reported[key])
            else:
                del self.reported[key]
                yield Notice(Topic.VALUE, f"{name} is well again", is_over=True)


@dataclass
class _WatchedRole:
    role: Role
    limits: RoleRange
    step: float
    noise: float
    held: float = np.nan  # value that it had in all of the last looks
    constant: int = 0  # looks in a row
    moved: int = 0  # of these, after the first, in which another input moved

    def is_frozen(self, values: Floats, others_move: bool) -> bool:
        """Whether the signal is frozen by now; values (n,): its samples since the last look."""
        first = float(values[0])
        if np.ptp(values) > 0.0 or (self.constant and first != self.held):
            self.constant, self.moved = 0, 0
            return False
        self.held = first
        self.constant += 1
        self.moved += others_move and self.constant > 1  # not in the first look: the line still swings
        if self.role is Role.RAIL_PRESSURE:
            return self.constant >= RAIL_LOOKS and self.moved >= 3 and self.noise >= self.step
        return self.moved >= 1

    def oddity(self, value: float) -> str:
        """Fault of a value in words; empty: none."""
        _, unit, size = SIGNALS[self.role]
        limits, half = self.limits, self.step / 2
        if np.isnan(value):
            return "says `not available` or `error`, or what its declared range excludes"
        if not abs(value) < IMPOSSIBLE[ROLES.index(self.role)]:
            return f"is impossible: {value / size:.3g} {unit}"
        if value >= limits.highest - half:
            return f"is at the upper end of its range, {limits.highest / size:.6g} {unit}"
        # a lift at rest may be clamped to 0
        if value <= limits.lowest + half and (self.role is not Role.NEEDLE_LIFT or limits.lowest < 0.0):
            return f"is at the lower end of its range, {limits.lowest / size:.6g} {unit}"
        return ""


class ValueWatch:
    """Looks some ten times a second at the newest values, and at the samples since it looked last."""

    def __init__(
        self, bus_map: BusMap, noise: NoiseLevels, sources: Sequence[WatchedMessage], has_lift: bool = True
    ) -> None:
        self._watched = []
        for role in ROLES if has_lift else (Role.RAIL_PRESSURE, Role.LINE_PRESSURE):
            limits = role_range(bus_map, role)
            step = role_resolution(bus_map, role, limits.highest)
            self._watched.append(_WatchedRole(role, limits, step, getattr(noise, role.value)))
        names = _names(sources)
        self._odd, self._frozen = _Findings(LOOKS, names), _Findings(1, names)
        self._is_frozen: dict[str, str] = {}

    @property
    def odd(self) -> Mapping[str, str]:
        """Signals without a possible value, as reported, in words with their remedy."""
        return self._odd.reported

    def look(self, newest: Floats, samples: Samples) -> Iterator[Notice]:
        """Notices; newest (3,) [SI]: last value received of every role, whether it could be used or not.

        A missing value is a fault only while there are no samples: the last frame of a window may be filled up so.
        """
        has_samples = len(samples[Role.LINE_PRESSURE]) > 0
        remedy = TOPICS[Topic.VALUE].remedy
        odd = {}
        for watched in self._watched:
            value = float(newest[ROLES.index(watched.role)])
            if not (has_samples and np.isnan(value)) and (oddity := watched.oddity(value)):
                odd[watched.role.value] = f"{oddity}\n  remedy: {remedy}"
        yield from self._odd.look(odd)
        if all(len(values) >= FEWEST for values in samples.values()):
            lift_moves = bool(np.ptp(samples[Role.NEEDLE_LIFT]) > LIFT_MOVED)
            pressure_moves = bool(np.ptp(samples[Role.LINE_PRESSURE] - samples[Role.RAIL_PRESSURE]) > PRESSURE_MOVED)
            for watched in self._watched:
                role = watched.role.value
                moves = pressure_moves if watched.role is Role.NEEDLE_LIFT else lift_moves
                is_frozen = watched.is_frozen(samples[watched.role], moves)
                if watched.constant == 0:
                    self._is_frozen.pop(role, None)
                elif is_frozen and role not in odd:
                    self._is_frozen[role] = f"{_FROZEN}\n  remedy: {remedy}"
            yield from self._frozen.look(self._is_frozen)


class RangeWatch:
    """Reports once, for each signal, values that are missing because they lie outside its declared range."""

    def __init__(self, bus_map: BusMap, signals: SignalsConfig) -> None:
        self._bus_map, self._signals = bus_map, signals
        self._reported: set[Role] = set()

    def look(self, receiver: np.void) -> Iterator[Notice]:
        """Notices; receiver: of the core."""
        for role, words in self.described(receiver, FEWEST).items():
            if role not in self._reported:
                self._reported.add(role)
                yield Notice(Topic.VALUE, f"{words}\n  remedy: {OUTSIDE_REMEDY}")

    def described(self, receiver: np.void, fewest: int = 1) -> dict[Role, str]:
        """Signals with so many values outside their range, in words; receiver: of the core."""
        highest = dict(zip(ROLES, receiver["highest"].tolist(), strict=True))
        words = {}
        for role, lowest, count in zip(ROLES, receiver["lowest"].tolist(), receiver["outside"].tolist(), strict=True):
            if count < fewest:
                continue
            limits, factor = role_range(self._bus_map, role), role_factor(self._bus_map, role)
            names = self._signals.of(role).names
            message = self._bus_map.input_layouts[message_of(self._bus_map, role)].name
            others = {Role.RAIL_PRESSURE, Role.LINE_PRESSURE} - {role}
            is_wrong = len(others) == 1 and highest[others.pop()] > limits.highest < highest[role]
            words[role] = (
                f"{role}: {count} values outside [{limits.lowest / factor:.6g}|{limits.highest / factor:.6g}] of "
                f"{names if isinstance(names, str) else names[0]} in {message} taken as missing, "
                f"of {lowest / factor:.6g} to {highest[role] / factor:.6g}"
                + ("; the other pressure goes as far, so that range is wrong" if is_wrong else "")
            )
        return words


class UnitWatch:
    """Judges the values of some seconds together, as files are judged when they are read."""

    def __init__(self, sources: Sequence[WatchedMessage]) -> None:
        self._findings = _Findings(SURVEYS, {**_names(sources), SWAPPED: "rail_pressure and line_pressure: each"})
        self._mixed_up: str | None = None  # as long as no injection tells
        self._restart()

    @property
    def reported(self) -> Mapping[str, str]:
        """Faults by signal, as reported, in words with their remedy."""
        return self._findings.reported

    def look(self, newest: Floats, samples: Samples) -> Iterator[Notice]:
        """Notices; newest (3,) [SI]: last value of every role; samples: since the last look."""
        for role, value in zip(ROLES, newest.tolist(), strict=True):
            _take_values(self._survey, role, np.array([value]))
        _take_values(self._survey, Role.NEEDLE_LIFT, samples[Role.NEEDLE_LIFT])
        for role in (Role.RAIL_PRESSURE, Role.LINE_PRESSURE):
            _take_values(self._swings, role, samples[role])
        self._looks += 1
        if self._looks < SURVEYED:
            return
        doubts = [*implausible(self._survey), *unshut(self._survey, FURTHEST_ZERO)]  # the first of a signal counts
        odd = {doubt.signal: f"{doubt.problem}\n  remedy: {doubt.remedy}" for doubt in doubts[::-1]}
        if self._survey.signals[Role.NEEDLE_LIFT.value].highest >= OPEN:
            self._mixed_up = "\n  remedy: ".join(swapped(self._swings) or ())
        if not odd and self._mixed_up:
            odd = {SWAPPED: self._mixed_up}
        self._restart()
        yield from self._findings.look(odd)

    def _restart(self) -> None:
        self._survey, self._swings = (Survey({role.value: SignalSurvey() for role in ROLES}) for _ in range(2))
        self._looks = 0


def _take_values(survey_of_all: Survey, role: Role, values: Floats) -> None:
    """Take in values (n,) that need not follow each other: their differences carry no meaning."""
    values = values[np.isfinite(values)]
    if values.size:
        survey = survey_of_all.signals[role.value]
        survey.lowest = min(survey.lowest, float(values.min()))
        survey.highest = max(survey.highest, float(values.max()))
        survey.total += float(values.sum())
        survey.count += values.size


class RateWatch:
    """Reports the rate that the bench file should state, if samples come at another and the model is contradicted.

    Only then: a recording that is replayed at another speed does not contradict the model.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._looks = 0
        self.reported = ""
        """The report in force, with its remedy; empty if there is none."""

    def look(self, timing: Sequence[MessageTiming], reason: Reason) -> Iterator[Notice]:
        """Notices of a look; reason: why the service is not valid."""
        off = [clock for clock in timing if abs(clock.drift) >= LARGEST_DRIFT and clock.jitter.frames >= MIN_FRAMES]
        self._looks = self._looks + 1 if off and reason is Reason.MODEL_INADEQUATE else 0
        if not off:
            self.reported = ""
        if self._looks == LASTING and not self.reported:
            actual = self._rate / (1.0 + off[0].drift)
            self.reported = (
                f"{off[0].name}: samples come at {actual:.6g} a second, sampling.rate_hz is {self._rate:g}\n"
                f"  remedy: sampling.rate_hz is likely {float(f'{actual:.3g}'):.9g}; nothing, if a recording is "
                "replayed at another speed"
            )
            yield Notice(Topic.INPUT, self.reported)


class LiftWatch:
    """Reports a lift sensor that is not to the injector's scale."""

    def __init__(self) -> None:
        self._is_to_scale = LiftFigures().is_to_scale

    def look(self, figures: LiftFigures) -> Iterator[Notice]:
        """Notices; figures: of the lift sensor."""
        if figures.is_to_scale == self._is_to_scale:
            return
        self._is_to_scale = figures.is_to_scale
        finding = "as the injector file says"
        if not figures.is_to_scale:
            finding = (
                f"not at seat.max_lift = {figures.stop / MICROMETRE:.0f} um of the injector file\n"
                "  remedy: calibrate the needle-lift sensor (or correct its factor), or correct seat.max_lift"
            )
        text = f"needle_lift: long openings stay at {figures.at_stop / MICROMETRE:.0f} um, {finding}"
        yield Notice(Topic.VALUE, text, figures.is_to_scale)


def _names(sources: Sequence[WatchedMessage]) -> dict[str, str]:
    """What begins a notice, by role."""
    roles = {role.value for role in ROLES}
    return {role: f"{source.text}: {role}" for source in sources for role in source.roles if role in roles}
