"""A worn injector of an independent plant as its sensors show it, for tests that disturb them."""

from functools import cache

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, record


@cache
def recorded(events: int, seed: int) -> Outcome:
    """With 30 % more nozzle area, at three pressures in turn; events: a multiple of three."""
    return recorded_at((60e6, 100e6, 140e6) * (events // 3), (1.4e-3,) * events, seed)


def recorded_at(rails: tuple[float, ...], openings: tuple[float, ...], seed: int) -> Outcome:
    """The same at these rail pressures [Pa], with the needle commanded for so long [s]."""
    made = tuple(
        Event(rail, (Shot(7e-6 * k, opening),), Faults(orifice_area=0.3))
        for k, (rail, opening) in enumerate(zip(rails, openings, strict=True))
    )
    return record(Bench(Injector(), Needle(), made, seed=seed))
