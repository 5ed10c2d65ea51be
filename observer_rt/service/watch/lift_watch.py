"""What the needle-lift sensor adds of its own, told once, and again when it is over."""

from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.observer.stream.lift_figures import LiftFigures
from observer_rt.service.watch.finding import WatchFinding

_PER = 10 * MEGAPASCAL


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


_NO_CROSSTALK = "needle_lift: the line pressure shows in it no more"


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
