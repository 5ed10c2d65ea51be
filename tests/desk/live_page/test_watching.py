"""A bench listened to live, through python-can: another participant of a bus with a daemon at work."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench import load_bench
from observer_rt.desk.live_page.watching import LiveSource, Watching
from tests.benches import block_bench
from tests.daemon.participants import bench_file, over_bus, until
from tests.device import frames_of, worn_recording


def test_injections_are_seen_beside_the_daemon(tmp_path: Path) -> None:
    path = bench_file(tmp_path, "watched-live")
    bench = load_bench(path)
    recording = worn_recording(4)
    watching = Watching(bench, LiveSource(bench))
    watching.start()
    try:
        heard, _ = over_bus(path, frames_of(bench, recording))
        until(lambda: len(watching.injectors()[0].injections) == len(heard.summaries) == 4)
        (seen,) = watching.injectors()
        (bus,) = watching.buses()
    finally:
        watching.close()
    assert watching.failure is None
    assert (watching.source.dropped, seen.lost, bus.down) == (0, 0, "")
    assert bus.load > 0.0
    for each in seen.injections:
        assert each.curves is not None
        volume = float(np.trapezoid(each.curves.rate, each.curves.time))
        assert abs(volume / each.summary.volume - 1.0) < 0.01


def test_every_interface_that_is_not_there_is_down_and_the_others_are_heard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there, *missing = channels = ["watched-there", "none1", "none2", "none3"]
    away = set(missing)

    def opened(interface: str, channel: str, fd: bool, computer_time: bool) -> Link:
        if channel in away:
            raise LinkDownError(f"{channel} is not there")
        return open_link(interface, channel, fd, computer_time=computer_time)

    monkeypatch.setattr("observer_rt.desk.live_page.watching.open_link", opened)
    bench = load_bench(block_bench(tmp_path, "virtual", channels))
    watching = Watching(bench, LiveSource(bench))
    watching.start()

    def down() -> list[str]:
        return [bus.down for bus in watching.buses()]

    try:
        until(lambda: down() == ["", *(f"{channel} is not there" for channel in missing)])
        with open_link("virtual", there, True) as device:
            until(lambda: device.send(0x110, bytes(64), False, True) or watching.buses()[0].load > 0.0)
        away.clear()
        until(lambda: not any(down()))
    finally:
        watching.close()
    assert watching.failure is None
