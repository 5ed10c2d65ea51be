"""Before the daemon is ready, all that an event calls has been called."""

from pathlib import Path

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.own_injections import INJECTIONS
from observer_rt.service.warm_up import warm_up


def test_injections_were_learned_from_and_judged(bench: Path) -> None:
    loaded = load_bench(bench)
    core = warm_up(loaded, map_bus(loaded))
    counters = core.counters
    assert (counters.injections, counters.adoptions) == (INJECTIONS, INJECTIONS)
    assert core.state == (State.ADAPTED, Reason.NONE)
