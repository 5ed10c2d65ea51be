"""The live page as its users see it, in a real browser."""

import json
import re
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from observer_rt.bus.links.link import BusFrame
from observer_rt.config.bench import load_bench
from tests.device import frames_of, worn_recording
from tests.service.participants import bench_file
from tests.three_injectors import (
    NAMES,
    frames_of_all,
    lift_id,
    one_alone,
    three_injectors,
    three_recordings,
)
from tests.watch.conftest import Serve
from tests.watch.traffic import Observed, traffic, write_log
from tools.benchmarks.live_page.browser import served

pytestmark = pytest.mark.slow
PATIENCE = 60_000  # ms, after which the machine is too slow or the page stuck
LIFT_ENDS = 0.12  # s, after which one injector's lift stays away
INJECTIONS = 10


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A bench with one injector, and a log of it."""
    folder = tmp_path_factory.mktemp("one")
    path = bench_file(folder, "can0", "socketcan")
    bench = load_bench(path)
    recording = worn_recording(INJECTIONS, 0.2)
    frames = frames_of(bench, recording)
    write_log(folder / "bus.log", list(traffic(frames, [Observed(bench)])), ["can0"])
    return path, folder / "bus.log"


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Three injectors, the needle lift of the second of which stays away from some moment on."""
    folder = tmp_path_factory.mktemp("three")
    path = three_injectors(folder, "can0", "socketcan")
    alone = [one_alone(folder, number, "can0") for number in range(len(NAMES))]
    frames = [
        frame
        for frame in frames_of_all(alone, three_recordings())
        if frame.frame_id != lift_id(1) or frame.time < LIFT_ENDS
    ]
    came = list(traffic(frames, [Observed(each) for each in load_bench(path).each]))
    write_log(folder / "bus.log", [*came, *_later(came)], ["can0"])
    return path, folder / "bus.log"


def _later(came: list[BusFrame]) -> Iterator[BusFrame]:
    """Some frames of all that still comes, seconds later: time goes on."""
    silent = lift_id(1)
    last = {each.frame.frame_id: each for each in came if each.frame.frame_id != silent}
    end = max(each.frame.stamp_ns for each in came)
    for tenth in range(1, 40):
        for each in last.values():
            yield each._replace(frame=each.frame._replace(stamp_ns=end + tenth * 100_000_000))


def test_traces_move_are_held_stepped_back_to_and_saved(
    one: tuple[Path, Path], serve: Serve, page: Page, tmp_path: Path
) -> None:
    bench, log = one
    page.goto(serve("--bench", bench, "--log", log, "--speed", "0.02", "--out", tmp_path / "kept"))
    number = page.locator("tr", has_text="injection").locator("td")
    expect(number).to_have_text(re.compile("[2-9] "), timeout=PATIENCE)
    before, first = page.locator(".side").first.screenshot(), number.inner_text()
    expect(number).not_to_have_text(first, timeout=PATIENCE)
    assert page.locator(".side").first.screenshot() != before

    page.get_by_role("button", name="Hold").click()
    expect(page.get_by_role("button", name="Go on")).to_be_visible()
    held = int(number.inner_text().split()[0])
    page.get_by_role("button", name="◀").click()
    expect(number).to_contain_text(str(held - 1))

    page.get_by_role("button", name="Save").click()
    expect(page.get_by_text("saved:")).to_be_visible(timeout=PATIENCE)
    saved = tmp_path / "kept" / f"injection_{held - 1}.csv"
    said = json.loads(saved.with_suffix(".json").read_text())
    assert said["injection_number"] == held - 1
    samples = np.genfromtxt(saved, delimiter=",", names=True)
    assert samples["needle_lift_mm"].max() > 0.1
    assert np.trapezoid(samples["published_rate_mm3_per_ms"], 1e3 * samples["time_s"]) == pytest.approx(
        said["volume"], rel=0.02
    )

    page.get_by_role("button", name="Go on").click()
    expect(number).to_contain_text(str(INJECTIONS - 1), timeout=PATIENCE)


def test_several_injectors_stand_side_by_side_and_a_fault_says_what_to_do(
    three: tuple[Path, Path], serve: Serve, page: Page
) -> None:
    bench, log = three
    page.goto(serve("--bench", bench, "--log", log))
    for name in NAMES:
        expect(page.locator(".state", has_text=name)).to_be_visible(timeout=PATIENCE)
    fault = page.locator(".fault", has_text="NeedleLiftBlock_two")
    expect(fault).to_contain_text("no frame for", timeout=PATIENCE)
    expect(fault).to_contain_text("since")
    expect(fault).to_contain_text("to do: the device that sends it, its cable")
    left, right = (page.locator(".state", has_text=name).bounding_box() for name in NAMES[:2])
    assert left is not None
    assert right is not None
    assert left["y"] == right["y"]
    assert left["x"] < right["x"]


def test_a_phone_has_no_scroll_bar_from_left_to_right(
    one: tuple[Path, Path], serve: Serve, page: Page
) -> None:
    bench, log = one
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(serve("--bench", bench, "--log", log))
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_page_that_has_lost_its_server_says_so_and_goes_on(
    one: tuple[Path, Path], page: Page, tmp_path: Path
) -> None:
    """Old numbers are not to be taken for new ones."""
    bench, log = one
    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    command: list[str | Path] = [
        sys.executable,
        "-m",
        "observer_rt",
        "monitor",
        "--port",
        str(port),
        "--bench",
        bench,
        "--log",
        log,
    ]
    lost = page.get_by_text("No connection to observer-rt monitor since")
    with served(command, tmp_path) as monitor:
        page.goto(monitor.url)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
        expect(lost).to_have_count(0)
    expect(lost).to_be_visible(timeout=PATIENCE)
    with served(command, tmp_path):
        expect(lost).to_have_count(0, timeout=PATIENCE)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
