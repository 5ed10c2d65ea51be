"""Who watches the loop hears of completed steps only: a link that hangs is not hidden by anything beside it."""

import threading
import time
from pathlib import Path

from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.service.daemon import Daemon
from tests.service.participants import ScriptedLink, bench_file, serving, until


class HangingLink(ScriptedLink):
    """Does not come back from `receive` while it is told so."""

    def __init__(self) -> None:
        super().__init__()
        self.may_return = threading.Event()
        self.may_return.set()

    def receive(self, timeout_s: float) -> Frame | None:
        self.may_return.wait()
        return super().receive(timeout_s)


def test_a_loop_that_hangs_is_not_alive(tmp_path: Path) -> None:
    bench = load_bench(bench_file(tmp_path, "alive"))
    link, alive = HangingLink(), list[float]()
    daemon = Daemon(bench, map_bus(bench), [link], on_alive=lambda: alive.append(time.monotonic()))
    with serving(daemon):
        until(lambda: len(alive) >= 5)
        link.may_return.clear()
        time.sleep(0.2)
        count = len(alive)
        time.sleep(0.5)
        assert len(alive) == count
        link.may_return.set()
        until(lambda: len(alive) > count + 3)
