"""The live page as its users see it, in a real browser, beside daemons that answer or do not."""

import json
import re
import signal
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from observer_rt.files.replay.framing import TimedFrame
from tests.daemon.end_to_end import command
from tests.daemon.participants import bench_file, until
from tests.desk.live_page.browser import served
from tests.desk.live_page.conftest import Serve
from tests.desk.live_page.daemons import daemons_of
from tests.device import frames_of, worn_recording
from tests.three_injectors import NAMES, lift_id, three_on

pytestmark = pytest.mark.slow
PATIENCE = 180_000  # ms, after which the machine is too slow or the page stuck
LIFT_ENDS = 0.12  # s, after which one injector's lift stays away
RED = "rgb(179, 38, 30)"


def frames_to(path: Path, injections: int = 10) -> list[TimedFrame]:
    return frames_of(path, worn_recording(injections, 0.2))


@pytest.fixture(scope="module")
def single_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    path = bench_file(tmp_path_factory.mktemp("one"), "can0")
    with daemons_of(path, frames_to(path)) as (daemon,):
        until(lambda: len(daemon.notes.injections) == 10)
        yield path


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Three injectors, a daemon each; the needle lift of the second stays away from some moment on."""
    scene = three_on(tmp_path_factory.mktemp("three"), "can0")
    frames = [each for each in scene.frames if each.frame_id != lift_id(1) or each.time < LIFT_ENDS]
    with daemons_of(scene.bench, frames):
        yield scene.bench


def number_of(page: Page) -> Locator:
    return page.locator(".letters tr", has_text="injection").locator("td")


# What stands in one frame: numbers of injections, in the title of the curve, in the table, in the titles of details.
_TOGETHER = """() => {
    window.seen = new Map();
    const look = () => {
        const table = document.querySelector("#numbers_0 td")?.innerText.split(" ")[0];
        const titles = ["rate_0", "line_pressure", "rail_pressure", "needle_lift"].map(
            (id) => document.querySelector(`#${id} .u-title`)?.innerText.match(/no\\. (\\d+)/)?.[1]);
        if (table && titles.every(Boolean)) window.seen.set(table, [table, ...titles]);
        requestAnimationFrame(look);
    };
    look();
}"""


def test_traces_move_are_held_stepped_back_to_and_saved(page: Page, serve: Serve, tmp_path: Path) -> None:
    path, number = bench_file(tmp_path, "can0"), number_of(page)
    with daemons_of(path, frames_to(path, 40), slowdown=8.0):
        page.goto(serve("--bench", path, "--out", tmp_path / "kept"))
        page.evaluate(_TOGETHER)
        expect(number).to_have_text(re.compile("[4-9] "), timeout=PATIENCE)
        before = page.locator("#injectors").screenshot()
        until(lambda: page.locator("#injectors").screenshot() != before)
        expect(page.locator(".well")).to_have_text("no fault")
        page.set_viewport_size({"width": 1600, "height": 900})
        page.wait_for_function("document.documentElement.scrollHeight <= innerHeight")
        page.wait_for_function("window.seen.size >= 5", timeout=PATIENCE)
        page.get_by_role("button", name="Hold").click()
        held = int(number.inner_text().split()[0])
        page.get_by_role("button", name="◀").click()
        expect(number).to_contain_text(str(held - 1))
        page.get_by_role("button", name="Save").click()
        expect(page.get_by_text("saved:")).to_be_visible(timeout=PATIENCE)
        page.get_by_role("button", name="Go on").click()
        until(lambda: int(number.inner_text().split()[0]) >= held + 3)
        page.get_by_role("button", name="Hold").click()
        page.locator("#place").evaluate("(slider) => { slider.value = 0; slider.oninput(); }")
        expect(number).to_contain_text("1 valid, flow 16 % above")  # its curves come from the server
        expect(page.locator("#rate_0 .u-title")).to_have_text("Injection rate, no. 1")
        expect(page.locator("#rate_0.empty")).to_have_count(0)
        for table, rate, *details in page.evaluate("[...window.seen.values()]"):
            assert (rate, len(set(details))) == (table, 1)
    saved = tmp_path / "kept" / f"injection_{held - 1}.csv"
    said = json.loads(saved.with_suffix(".json").read_text())
    assert said["number"] == held - 1
    samples = np.genfromtxt(saved, delimiter=",", names=True)
    assert samples["needle_lift_um"].max() > 100.0
    volume = np.trapezoid(samples["corrected_rate_mm3_per_ms"], samples["time_ms"])
    assert 0.83 * volume == pytest.approx(said["mass_mg"], rel=1e-3)


def test_several_injectors_stand_side_by_side_and_a_fault_has_a_remedy(three: Path, serve: Serve, page: Page) -> None:
    page.goto(serve("--bench", three))
    for name in NAMES:
        state = page.locator(".state", has=page.locator(".name", has_text=name))
        expect(state).to_be_visible(timeout=PATIENCE)
    fault = page.locator(".fault", has_text="NeedleLiftBlock_two")
    expect(fault).to_contain_text("no frame for", timeout=PATIENCE)
    expect(fault).to_contain_text("since")
    expect(fault).to_contain_text("to do: the device that sends it, its cable")
    assert page.evaluate("document.documentElement.scrollHeight") <= 1080
    left, right = (page.locator(f"#injector_{k}").bounding_box() for k in (0, 1))
    assert left is not None
    assert right is not None
    assert left["y"] == right["y"]
    assert left["x"] < right["x"]
    third = page.get_by_role("button", name=NAMES[2])
    third.click()
    expect(third).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#line_pressure .u-title")).to_contain_text(NAMES[2])
    for width in (1920, 390):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate(_CUT) == 0


# Faults that end below the place they stand in, once there are five: at once, for the page goes on.
_CUT = """() => {
    const one = document.querySelector(".fault");
    for (let k = 0; k < 4; k++) one.after(one.cloneNode(true));
    const end = (each) => each.getBoundingClientRect().bottom;
    return [...one.parentElement.children].filter((each) => end(each) > end(one.parentElement) + 1).length;
}"""
_BOXES = """() => [...document.querySelectorAll("#top, .mass, .letters tr, #controls button, .u-title, .u-wrap")]
    .map((each) => each.getBoundingClientRect().toJSON()).filter((each) => each.width > 0)"""


def test_nothing_is_hidden_however_wide_the_window_is(single_bench: Path, serve: Serve, page: Page) -> None:
    page.goto(serve("--bench", single_bench))
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
    assert page.evaluate("document.documentElement.scrollHeight") <= 1080
    page.get_by_role("button", name="Hold").click()
    page.locator("#place").evaluate("(slider) => { slider.value = 0; slider.oninput(); }")
    expect(number_of(page)).to_have_text(re.compile(r"^1 valid, flow .{15,}"))  # wraps on a phone
    page.get_by_role("button", name="φ").click()
    expect(page.locator("#orifice_area_pressure_drop_MPa:not(.empty) .u-wrap")).to_be_visible()
    for width in (1920, 1600, 1280, 1000, 800, 390):
        page.set_viewport_size({"width": width, "height": 844})
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
        for _ in range(50):  # the curves follow the window a little later
            boxes = page.evaluate(_BOXES)
            hidden = [pair for pair in combinations(boxes, 2) if overlap(*pair) >= 1.0]
            if not hidden:
                break
            page.wait_for_timeout(100)
        assert (width, hidden) == (width, [])
        assert len(boxes) >= 20


def overlap(box: dict[str, float], other: dict[str, float]) -> float:
    """Pixels by which two boxes overlap, across or down, whichever is less."""
    across = min(box["right"], other["right"]) - max(box["left"], other["left"])
    return min(across, min(box["bottom"], other["bottom"]) - max(box["top"], other["top"]))


def test_a_page_of_another_name_is_not_served(single_bench: Path, serve: Serve) -> None:
    """A foreign name may lead here: who owns it is not to see the bench."""
    url = serve("--bench", single_bench)
    for path in ("", "page.js", "drawings"):
        with pytest.raises(HTTPError, match="404"):
            urlopen(Request(url + path, headers={"Host": "elsewhere.example"}))


def test_a_page_for_other_computers_asks_for_its_token(single_bench: Path, page: Page, serve: Serve) -> None:
    result = urlsplit(serve("--address", "0.0.0.0", "--bench", single_bench))
    assert not str(result.hostname).startswith(("127.", "0.", "localhost"))  # one that others can open
    url = result._replace(netloc=f"127.0.0.1:{result.port}").geturl()
    bare, _, token = url.partition("?token=")
    assert len(token) >= 16
    for path in ("", "page.js", "drawings", "?token=", "?token=guessed", f"page.js?token={token[:-1]}"):
        with pytest.raises(HTTPError, match="403"):
            urlopen(bare + path)
    for address in (url, bare):  # then by the cookie
        page.goto(address)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)


# Visible elements that look as if all were well: green ones, and curves or numbers in full colour.
_ALIVE = """() => [...document.querySelectorAll(".state, .well, .numbers, .uplot")]
    .filter((each) => each.checkVisibility())
    .filter((each) => (each.matches(".state, .well")
        ? [getComputedStyle(each).backgroundColor, getComputedStyle(each).color].includes("rgb(24, 128, 56)")
        : !getComputedStyle(each).filter.includes("grayscale") && !each.matches(".old")))
    .map((each) => each.className)"""


def test_nothing_looks_alive_beside_a_silent_daemon_and_it_goes_on(serve: Serve, page: Page, tmp_path: Path) -> None:
    path, state = bench_file(tmp_path, "can0"), page.locator(".state")
    for _ in range(2):
        with daemons_of(path, frames_to(path)):
            if page.url == "about:blank":
                page.goto(serve("--bench", path))
            expect(state).not_to_contain_text("SILENT", timeout=PATIENCE)
            expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
            page.wait_for_function(f"({_ALIVE})().length > 0")
        expect(state).to_contain_text("OBSERVER SILENT", timeout=PATIENCE)
        expect(state).to_have_css("background-color", RED)
        expect(page.locator(".fault")).to_contain_text("to do: start `observer-rt run")
        page.wait_for_function(f"({_ALIVE})().length === 0")


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGSTOP])
def test_nothing_looks_alive_once_the_monitor_is_lost_and_the_page_goes_on(
    single_bench: Path, page: Page, tmp_path: Path, how: signal.Signals
) -> None:
    """Old numbers are not to be taken for new ones."""
    lost = page.get_by_text("No connection to observer-rt monitor since")
    words = command("monitor", "--bench", single_bench, "--port")
    with served([*words, "0"], tmp_path) as monitor:
        page.goto(monitor.url)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
        expect(lost).to_have_count(0)
        monitor.process.send_signal(how)
        expect(lost).to_be_visible(timeout=PATIENCE)
        expect(page.locator(".state")).to_have_css("background-color", RED)
        assert page.evaluate(_ALIVE) == []
        if how == signal.SIGSTOP:
            monitor.process.send_signal(signal.SIGCONT)
            expect(lost).to_have_count(0, timeout=PATIENCE)
            return
    with served([*words, str(urlsplit(monitor.url).port)], tmp_path):
        expect(lost).to_have_count(0, timeout=PATIENCE)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
