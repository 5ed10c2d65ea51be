"""A bench listened to live, through python-can: another participant of a bus with a daemon at work."""

import threading
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import BusFrame, Frame, Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench import load_bench
from observer_rt.desk.live_page.page.letters import top_html
from observer_rt.desk.live_page.watching import FrameSource, LiveSource, Taker, Watching
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


class Crowded(FrameSource):
    """Frames of 64 bytes, some a second, for two seconds."""

    def __init__(self, a_second: int) -> None:
        self._a_second = a_second

    def run(self, take: Taker, stop: threading.Event) -> None:
        for number in range(2 * self._a_second):
            stamp = (1 + number) * 1_000_000_000 // self._a_second
            take(BusFrame(0, Frame(0x7AA, bytes(64), stamp, False, True)), stamp)


@pytest.mark.parametrize(("a_second", "is_full"), [(2000, False), (10_000, True)])
def test_a_bus_with_more_frames_than_it_carries_is_a_fault(
    tmp_path: Path, a_second: int, is_full: bool
) -> None:
    watching = Watching(load_bench(bench_file(tmp_path, "can0")), Crowded(a_second))
    watching.start()
    until(lambda: watching.is_over)
    full = [fault for fault in watching.injectors()[0].faults if "can0 is full" in fault.what]
    assert len(full) == is_full
    assert all("windows" in fault.remedy for fault in full)
    assert ("bus bad" in top_html(watching)) == is_full
