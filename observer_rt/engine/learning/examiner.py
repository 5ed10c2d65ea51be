"""Examination of events with the parameters in force, which sees what was judged before; no clock, no thread."""

from dataclasses import dataclass

from observer_rt.engine.estimation.healthy_course import expected_in
from observer_rt.engine.estimation.phases import PhaseStatistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Parameter, Theta, sensor_lag
from observer_rt.engine.learning import adequacy
from observer_rt.engine.learning.disturbances.colour import Colour
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.engine.stream.state import Constants, Reason

BELIEVED_AFTER = 2  # explained events after one that was not, in a row or not; the last of them is believed
SETTLED = 3  # explained events in a row, after which one that is not is a fault that may pass


@dataclass(frozen=True, eq=False)
class Examination:
    """Objections to an event, and the statistics over recent events with it."""

    objections: tuple[adequacy.Objection, ...]  # empty: it passed
    statistics: PhaseStatistics
    passed: int = 0  # events in a row that did, SETTLED at most; negative: that must until one is believed again


class Examiner:
    """Finds the objections to one event after the other, and keeps what the next is judged by."""

    def __init__(self, statistics: PhaseStatistics, healthy: Healthy, colour: Colour | None = None) -> None:
        """statistics: over the events before the first; colour: of the innovations then, None if they are white."""
        self._healthy = healthy
        self._passed = 0
        self.colour = colour
        """Colour of the innovations; as the statistics, whoever learns from an event replaces it by what it found."""
        self.statistics = statistics
        """Over recent events; whoever learns from an event replaces them by what was found."""

    def take(self, examination: Examination) -> None:
        """Takes over how an event was judged."""
        self.statistics, self._passed = examination.statistics, examination.passed

    def examine(
        self, window: Window | None, innovations: adequacy.Innovations, in_force: Theta, constants: Constants
    ) -> Examination:
        """Judges one event.

        One that is refused by itself says nothing of those after it, but that one must pass first; two, where it was
        not long since: a wrong model is not contradicted at every operating point.

        window: None where it cannot be tested; in_force (m,) and constants: during it.
        """
        if window is None:
            return Examination((adequacy.Objection(Reason.NOT_JUDGED),), self.statistics, self._passed)
        if self._healthy.shape is not None:
            expected = expected_in(self._healthy.shape, window, constants.coefficients, constants.interval)
            innovations = innovations._replace(values=innovations.values - expected)
        if self.colour is not None:
            innovations = adequacy.Innovations(
                self.colour.whitening.of(innovations.values, window.masked), self.colour.sigma
            )
        event = adequacy.event_statistics(window, innovations, constants.interval, self._healthy)
        lag = sensor_lag(in_force)
        offset, untold = _offset(window, in_force, constants)
        if adequacy.inadequate_phase(event) is not None:
            raised = adequacy.objections(event, offset, lag, self._healthy, untold)
            to_pass = 1 if self._passed >= SETTLED else BELIEVED_AFTER
            return Examination(tuple(raised), self.statistics, self._passed if self._passed < 0 else -to_pass)
        statistics = adequacy.pooled(self.statistics, event)
        raised = adequacy.objections(statistics, offset, lag, self._healthy, untold)
        passed = self._passed if raised else min(self._passed + 1, SETTLED)
        if passed < 0 and not raised:
            raised = [adequacy.Objection(Reason.MODEL_INADEQUATE)]
        return Examination(tuple(raised), statistics, passed)


def _offset(window: Window, in_force: Theta, constants: Constants) -> tuple[float, float]:
    """Line over rail pressure [Pa] with the needle shut before the event, and what a gain may be of it."""
    shut, scale = slice(0, max(window.opening, 1)), constants.coefficients.pressure_scale
    rail, gain = window.inputs[shut, 0], float(in_force[Parameter.LINE_PRESSURE_GAIN])
    difference = window.output[shut] - (1.0 + gain) * rail
    mean = float(difference.sum()) / difference.size
    untold = constants.calibration.gain if gain == 0.0 else 0.0
    return (mean - constants.sensor.offset) * scale, untold * float(rail[0]) * scale
