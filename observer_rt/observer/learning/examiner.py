"""Events that nothing was learned from are judged all the same: by the innovations the live x~ had on them."""

from dataclasses import dataclass

from observer_rt.estimation.phases import PhaseStatistics
from observer_rt.estimation.predictor import Window
from observer_rt.estimation.scalars import Parameter, Theta
from observer_rt.model.sensor import LAG_UNIT
from observer_rt.observer.learning.adequacy import (
    Innovations,
    Objection,
    event_statistics,
    objections,
    pooled,
)
from observer_rt.observer.learning.disturbances.colour import Colour
from observer_rt.observer.learning.indicators import Healthy
from observer_rt.observer.stream.state import Constants, Reason


@dataclass(frozen=True, eq=False)
class Examination:
    """What speaks against an event (empty: it passed), and the statistics over recent events with it."""

    objections: tuple[Objection, ...]
    statistics: PhaseStatistics


class Examiner:
    """What speaks against an event with the parameters in force. Pure: no clock, no thread."""

    def __init__(self, statistics: PhaseStatistics, healthy: Healthy, colour: Colour | None = None) -> None:
        """statistics: over the events before the first; colour: of the innovations then, None if they are white."""
        self._healthy = healthy
        self.colour = colour
        """Of the innovations; as the statistics, whoever learns from an event replaces it by what it found."""
        self.statistics = statistics
        """Over recent events; whoever learns from an event, or has one examined, replaces them by what was found."""

    def examine(
        self, window: Window | None, innovations: Innovations, in_force: Theta, constants: Constants
    ) -> Examination:
        """Judge one event.

        window: None where it cannot be tested; in_force (m,) and constants: during it.
        """
        if window is None:
            return Examination((Objection(Reason.NOT_JUDGED),), self.statistics)
        if self.colour is not None:
            innovations = Innovations(
                self.colour.whitening.of(innovations.values, window.masked), self.colour.sigma
            )
        event = event_statistics(window, innovations, constants.interval, self._healthy)
        statistics = pooled(self.statistics, event)
        lag = float(in_force[Parameter.SENSOR_LAG]) * LAG_UNIT
        found = tuple(objections(statistics, _offset(window, constants), lag, self._healthy))
        return Examination(found, statistics)


def _offset(window: Window, constants: Constants) -> float:
    """Line over rail pressure [Pa] with the needle shut before the event."""
    shut = slice(0, max(window.opening, 1))
    difference = window.output[shut] - window.inputs[shut, 0]
    mean = float(difference.sum()) / difference.size
    return (mean - constants.sensor.offset) * constants.coefficients.pressure_scale
