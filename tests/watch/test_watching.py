"""A bench listened to live, through python-can: another participant of a bus with a daemon at work."""

from pathlib import Path

import numpy as np

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import Framer, whole
from observer_rt.watch.listening import LiveSource
from observer_rt.watch.watching import Watching
from tests.service.participants import bench_file, over_bus, until, worn_recording


def test_injections_are_seen_beside_the_daemon(tmp_path: Path) -> None:
    path = bench_file(tmp_path, "watched-live")
    bench = load_bench(path)
    recording = worn_recording(4)
    watching = Watching(bench, LiveSource(bench))
    watching.start()
    try:
        heard, _ = over_bus(path, list(Framer(map_bus(bench)).frames(recording, whole(recording))))
        until(lambda: len(watching.injectors()[0].injections) == len(heard.summaries) == 4)
        (seen,) = watching.injectors()
        (bus,) = watching.buses()
    finally:
        watching.close()
    assert watching.failure is None
    assert (watching.dropped, seen.lost, bus.down) == (0, 0, "")
    assert bus.load > 0.0
    for each in seen.injections:
        volume = float(np.trapezoid(each.curves.rate, each.curves.time))
        assert abs(volume / each.summary.volume - 1.0) < 0.01
