"""Whether what comes in can be an injector's at all: a signal in another unit than is said, or upside down."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.signals import Role
from observer_rt.recording.signals.plausible import SignalSurvey, Survey, implausible
from observer_rt.service.reports.news import Notice
from observer_rt.service.watch.arrivals import WatchedMessage
from observer_rt.service.words import Topic

LOOKS = 10  # whose values are judged together
IN_A_ROW = 2  # times that the same is found, before it is told


class UnitWatch:
    """Judges the values of some seconds together, as files are judged when they are read."""

    def __init__(self, sources: Sequence[WatchedMessage]) -> None:
        self._named = {role: f"{source.text}: {role}" for source in sources for role in source.roles}
        self._begin()
        self._found: Mapping[str, str] = {}
        self._times = 0  # in a row that this was found
        self.told: Mapping[str, str] = {}
        """What is wrong by signal, which was told, in words with its remedy."""

    def look(self, newest: NDArray[np.float64], lifts: NDArray[np.float64]) -> list[Notice]:
        """News; newest (3,) [SI]: last value of every role, lifts: of the samples since the last look."""
        for role, value in zip(ROLES, newest.tolist(), strict=True):
            self._take(role, np.array([value]))
        self._take(Role.NEEDLE_LIFT, lifts)
        self._looks += 1
        if self._looks < LOOKS:
            return []
        odd = {
            each.signal: f"{self._named[each.signal]} {each.problem}\n  remedy: {each.remedy}"
            for each in reversed([*implausible(self._survey)])  # of several of a signal the first
        }
        self._begin()
        self._times = self._times + 1 if odd.keys() == self._found.keys() else 1
        self._found = odd
        if self._times < IN_A_ROW or odd.keys() == self.told.keys():
            return []
        before, self.told = self.told, odd
        told = [Notice(Topic.VALUE, text) for signal, text in odd.items() if signal not in before]
        over = [signal for signal in before if signal not in odd]
        return told + [
            Notice(Topic.VALUE, f"{self._named[signal]} is in its range again", is_over=True)
            for signal in over
        ]

    def _begin(self) -> None:
        self._survey = Survey({role.value: SignalSurvey() for role in ROLES})
        self._looks = 0

    def _take(self, role: Role, values: NDArray[np.float64]) -> None:
        values = values[np.isfinite(values)]
        if values.size:
            survey = self._survey.signals[role.value]
            survey.lowest = min(survey.lowest, float(values.min()))
            survey.highest = max(survey.highest, float(values.max()))
            survey.total += float(values.sum())
            survey.count += values.size
