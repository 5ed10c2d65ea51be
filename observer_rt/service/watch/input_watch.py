"""All watches of a core's inputs together."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.observer.stream.lift_figures import LiftFigures
from observer_rt.service.compiled.constants import configured_noise
from observer_rt.service.core.core import Core
from observer_rt.service.reports.news import Notice
from observer_rt.service.watch.arrivals import Arrivals
from observer_rt.service.watch.finding import WatchFinding
from observer_rt.service.watch.senders import SenderWatch
from observer_rt.service.watch.silence import SilenceWatch
from observer_rt.service.watch.values import ValueWatch
from observer_rt.service.words import Topic

PERIOD = 100_000_000  # ns between two looks
MOST_SAMPLES = 1024  # of a look, which the loop waits for
_PER = 10 * MEGAPASCAL
_NO_CROSSTALK = "needle_lift: the line pressure shows in it no more"


class InputWatch:
    """Says of the inputs of a core what is wrong with them, by message and identifier."""

    def __init__(self, fitted: BenchInjector, bus: BusMap, core: Core) -> None:
        self.arrivals = Arrivals(bus)
        self._core = core
        self._silence = SilenceWatch(self.arrivals)
        self._values = ValueWatch(bus, configured_noise(fitted))
        self._lift = LiftWatch()
        self._senders = SenderWatch(bus, self.arrivals)
        self._seen = 0
        self._frames = 0

    def look(self, now: int) -> list[Notice]:
        """News at a time [ns] of the arrivals' clock; to be called every `PERIOD`."""
        core = self._core
        found = self._silence.look(now, core.progress)
        values = []
        has_frames = core.frames_taken > self._frames
        self._frames = core.frames_taken
        if has_frames and self.arrivals.is_complete and not self.arrivals.stale(now):
            values = self._values.look(core.newest, self._samples())
        return [
            *_notices(Topic.INPUT, found),
            *_notices(Topic.VALUE, values),
            *_notices(Topic.VALUE, self._lift.look(core.lift)),
            *_notices(Topic.SENDER, self._senders.look(now)),
        ]

    def _samples(self) -> dict[Role, NDArray[np.float64]]:
        samples = self._core.inputs(self._seen, MOST_SAMPLES)
        self._seen = self._core.processed
        return samples


def _notices(topic: Topic, findings: list[WatchFinding]) -> list[Notice]:
    return [Notice(topic, found.text, found.is_over) for found in findings]


class LiftWatch:
    """Looks at the figures of the lift sensor."""

    def __init__(self) -> None:
        self._pressed = False
        self._to_scale = True

    def look(self, figures: LiftFigures) -> list[WatchFinding]:
        """News."""
        told = []
        pressed = figures.crosstalk != 0.0
        if pressed != self._pressed:
            self._pressed = pressed
            told.append(_crosstalk(figures) if pressed else WatchFinding(_NO_CROSSTALK, is_over=True))
        if figures.is_to_scale != self._to_scale:
            self._to_scale = figures.is_to_scale
            told.append(_scale(figures))
        return told


def _crosstalk(figures: LiftFigures) -> WatchFinding:
    size = figures.crosstalk * _PER / MICROMETRE
    return WatchFinding(
        f"needle_lift: the line pressure shows in it, {size:.2g} um per 10 MPa, which is taken out\n"
        "  remedy: none is needed; see to mounting, cable and ground of the needle-lift sensor"
    )


def _scale(figures: LiftFigures) -> WatchFinding:
    found = f"needle_lift: long openings stay at {figures.at_stop / MICROMETRE:.0f} um"
    if figures.is_to_scale:
        return WatchFinding(f"{found}, as the injector file says", is_over=True)
    return WatchFinding(
        f"{found}, not at seat.max_lift = {figures.stop / MICROMETRE:.0f} um of the injector file\n"
        "  remedy: calibrate the needle-lift sensor (or correct its factor), or correct seat.max_lift"
    )
