"""The live page as its users see it, in a real browser."""

import json
import re
import socket
from itertools import combinations
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from observer_rt.config.bench import load_bench
from tests.device import frames_of, worn_recording
from tests.service.end_to_end import command
from tests.service.participants import bench_file, until
from tests.three_injectors import NAMES, lift_id, three_on
from tests.watch.conftest import Serve
from tests.watch.traffic import Observed, traffic, write_log
from tools.benchmarks.live_page.watched import served

pytestmark = pytest.mark.slow
PATIENCE = 60_000  # ms, after which the machine is too slow or the page stuck
LIFT_ENDS = 0.12  # s, after which one injector's lift stays away
INJECTIONS = 10
Options = tuple[str | Path, ...]


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Options:
    """A bench with one injector, and a log of it."""
    folder = tmp_path_factory.mktemp("one")
    path, log = bench_file(folder, "can0", "socketcan"), folder / "bus.log"
    bench = load_bench(path)
    frames = frames_of(bench, worn_recording(INJECTIONS, 0.2))
    write_log(log, list(traffic(frames, [Observed(bench)])), ["can0"])
    return "--bench", path, "--log", log


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Options:
    """Three injectors, the needle lift of the second of which stays away from some moment on; then time goes on."""
    folder = tmp_path_factory.mktemp("three")
    scene, log = three_on(folder, "can0", "socketcan"), folder / "bus.log"
    silent = lift_id(1)
    frames = [each for each in scene.frames if each.frame_id != silent or each.time < LIFT_ENDS]
    came = list(traffic(frames, [Observed(each) for each in load_bench(scene.bench).each]))
    last = {each.frame.frame_id: each for each in came if each.frame.frame_id != silent}.values()
    end = max(each.frame.stamp_ns for each in came)
    later = [
        each._replace(frame=each.frame._replace(stamp_ns=end + tenth * 100_000_000))
        for tenth in range(1, 40)
        for each in last
    ]
    write_log(log, [*came, *later], ["can0"])
    return "--bench", scene.bench, "--log", log


def test_traces_move_are_held_stepped_back_to_and_saved(
    one: Options, serve: Serve, page: Page, tmp_path: Path
) -> None:
    page.goto(serve(*one, "--speed", "0.02", "--out", tmp_path / "kept"))
    number = page.locator(".letters tr", has_text="injection").locator("td")
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
    three: Options, serve: Serve, page: Page
) -> None:
    page.goto(serve(*three))
    for name in NAMES:
        expect(page.locator(".state", has=page.locator(".name", has_text=name))).to_be_visible(
            timeout=PATIENCE
        )
    fault = page.locator(".fault", has_text="NeedleLiftBlock_two")
    expect(fault).to_contain_text("no frame for", timeout=PATIENCE)
    expect(fault).to_contain_text("since")
    expect(fault).to_contain_text("to do: the device that sends it, its cable")
    left, right = (
        page.locator(".state", has=page.locator(".name", has_text=name)).bounding_box() for name in NAMES[:2]
    )
    assert left is not None
    assert right is not None
    assert left["y"] == right["y"]
    assert left["x"] < right["x"]

    third = page.get_by_role("button", name=NAMES[2])
    before = page.locator("#phi").screenshot()
    third.click()
    expect(third).to_have_attribute("aria-pressed", "true")
    until(lambda: page.locator("#phi").screenshot() != before)


_BOXES = """() => [...document.querySelectorAll("#top, .mass, .letters tr, #controls button, .u-title, .u-wrap")]
    .map((each) => each.getBoundingClientRect().toJSON()).filter((each) => each.width > 0)"""


def test_nothing_is_hidden_however_wide_the_window_is(one: Options, serve: Serve, page: Page) -> None:
    page.goto(serve(*one))
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
    for width in (1920, 1600, 1280, 1000, 800, 390):
        page.set_viewport_size({"width": width, "height": 844})
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
        boxes = page.evaluate(_BOXES)
        assert len(boxes) >= 20
        for box, other in combinations(boxes, 2):
            across = min(box["right"], other["right"]) - max(box["left"], other["left"])
            down = min(box["bottom"], other["bottom"]) - max(box["top"], other["top"])
            assert min(across, down) < 1.0, (width, box, other)


def test_the_pointer_reads_values_off_the_curves(one: Options, serve: Serve, page: Page) -> None:
    page.goto(serve(*one))
    lift = page.locator("#needle_lift")
    value = lift.locator(".u-series", has_text="sensor").locator(".u-value")
    expect(value).to_be_hidden()
    room = lift.locator(".u-over").bounding_box()
    assert room is not None
    lift.locator(".u-over").hover(position={"x": 0.36 * room["width"], "y": 20.0})  # where the needle is open
    expect(value).to_have_text(re.compile(r"^(29\d|30\d)(\.\d)?$"), timeout=PATIENCE)


def test_a_page_of_another_name_is_not_served(one: Options, serve: Serve) -> None:
    """A foreign name may lead here: who owns it is not to see the bench."""
    url = serve(*one)
    with urlopen(url) as found:
        assert found.status == 200
    for path in ("", "page.js", "drawings"):
        with pytest.raises(HTTPError, match="404"):
            urlopen(Request(url + path, headers={"Host": "elsewhere.example"}))


def test_a_page_for_other_computers_asks_for_its_token(one: Options, page: Page, serve: Serve) -> None:
    url = serve("--address", "0.0.0.0", *one).replace("0.0.0.0", "127.0.0.1")
    bare, _, token = url.partition("?token=")
    assert len(token) >= 16
    for path in ("", "page.js", "drawings", "?token=", "?token=guessed", f"page.js?token={token[:-1]}"):
        with pytest.raises(HTTPError, match="403"):
            urlopen(bare + path)
    page.goto(url)
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
    page.goto(bare)  # by the cookie
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)


def test_a_page_that_has_lost_its_server_says_so_and_goes_on(
    one: Options, page: Page, tmp_path: Path
) -> None:
    """Old numbers are not to be taken for new ones."""
    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    words = command("monitor", "--port", str(port), *one)
    lost = page.get_by_text("No connection to observer-rt monitor since")
    with served(words, tmp_path) as monitor:
        page.goto(monitor.url)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
        expect(lost).to_have_count(0)
    expect(lost).to_be_visible(timeout=PATIENCE)
    with served(words, tmp_path):
        expect(lost).to_have_count(0, timeout=PATIENCE)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
