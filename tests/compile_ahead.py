"""Compile what most tests call, once, before every worker would compile it for itself.

`python -m tests.compile_ahead lump`, or `wave`: what a simulation and the daemon need on the line of the nominal
injector, or of that of docs/own-injector.md.
"""

import shutil
import sys
import tempfile
from pathlib import Path

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.service.core.core import Core
from observer_rt.service.warm_up import warm_up
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import simulate
from tests import own_injector

PERIOD = 30 * MILLISECOND


def main(line: str, folder: Path) -> None:
    """Warm the daemon up, and simulate an injection."""
    for path in EXAMPLE_BENCH.parent.glob("*.*"):
        shutil.copy(path, folder)
    bench = folder / EXAMPLE_BENCH.name
    if line == "wave":
        own_injector.write_files(folder)
        text = bench.read_text()
        changed = text.replace('# file = "injector.toml"', 'file = "plant.toml"')
        assert changed != text
        bench.write_text(changed)
    loaded = load_bench(bench)
    warm_up(loaded, map_bus(loaded))  # by the compiled pump
    core = Core(loaded.injector, map_bus(loaded))  # as other interfaces do
    core.handle(0, False, b"", 0)
    core.finish()
    schedule = make_schedule([100 * MEGAPASCAL], 1, PERIOD, [MILLISECOND])
    made = simulate(loaded.injector.parameters, schedule, loaded.injector.config.sampling.rate_hz)
    evaluate(loaded, [made.recording])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        main(sys.argv[1], Path(name))
