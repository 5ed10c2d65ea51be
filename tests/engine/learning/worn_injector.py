"""A worn injector of an independent plant on a bench, for tests that disturb its signals."""

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, Step, Surroundings


def worn_bench(rails: tuple[float, ...], openings: tuple[float, ...], seed: int, *steps: Step) -> Bench:
    """With 30 % more nozzle area, at these rail pressures [Pa], with the needle commanded for so long [s].

    steps: what becomes of the samples.
    """
    made = tuple(
        Event(rail, (Shot(7e-6 * k, opening),), Faults(orifice_area=0.3))
        for k, (rail, opening) in enumerate(zip(rails, openings, strict=True))
    )
    return Bench(Injector(), Needle(), made, seed=seed, around=Surroundings(after_noise=steps))


def in_turn(events: int, seed: int, *steps: Step) -> Bench:
    """The same at three pressures in turn; events: a multiple of three."""
    return worn_bench((60e6, 100e6, 140e6) * (events // 3), (1.4e-3,) * events, seed, *steps)
