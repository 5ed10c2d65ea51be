"""The live page as its users see it, in a real browser."""

import json
import re
import signal
import socket
from itertools import combinations
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from tests.daemon.end_to_end import command
from tests.daemon.participants import bench_file, until
from tests.desk.live_page.browser import served
from tests.desk.live_page.conftest import Serve
from tests.desk.live_page.traffic import BEGIN, Observed, traffic, write_log
from tests.device import frames_of, worn_recording
from tests.three_injectors import NAMES, lift_id, three_on

pytestmark = pytest.mark.slow
PATIENCE = 60_000  # ms, after which the machine is too slow or the page stuck
STATUS_ENDS = 2.0  # s, after which the observer sends nothing
LIFT_ENDS = 0.12  # s, after which one injector's lift stays away
INJECTIONS = 10
SECOND = 1_000_000_000  # ns
RED = "rgb(179, 38, 30)"
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
def silenced(one: Options, tmp_path_factory: pytest.TempPathFactory) -> Options:
    """The same, but the observer falls silent; its inputs go on."""
    folder = tmp_path_factory.mktemp("silenced")
    bench = load_bench(Path(one[1]))
    frames = frames_of(bench, worn_recording(60, 0.2))
    came = traffic(frames, [Observed(bench)])
    inputs = {layout.frame_id for layout in map_bus(bench).received}
    heard = [
        each
        for each in came
        if each.frame.frame_id in inputs or each.frame.stamp_ns - BEGIN < STATUS_ENDS * SECOND
    ]
    write_log(folder / "bus.log", heard, ["can0"])
    return "--bench", one[1], "--log", folder / "bus.log"


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
    before, first = page.locator("#injectors").screenshot(), number.inner_text()
    expect(number).not_to_have_text(first, timeout=PATIENCE)
    assert page.locator("#injectors").screenshot() != before

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
    before = page.locator("#line_pressure").screenshot()
    third.click()
    expect(third).to_have_attribute("aria-pressed", "true")
    until(lambda: page.locator("#line_pressure").screenshot() != before)


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


def test_a_long_reason_wraps_on_a_phone(one: Options, serve: Serve, page: Page) -> None:
    """Else the whole page is drawn at half its size just when something is wrong."""
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(serve(*one, "--speed", "0.02"))
    number = page.locator(".letters tr", has_text="injection").locator("td")
    expect(number).to_contain_text("not valid: ", timeout=PATIENCE)
    page.get_by_role("button", name="Hold").click()
    page.get_by_role("button", name="◀").click()
    expect(number).to_have_text(re.compile(r"^1 not valid: [A-Z_]+, .{20,}"))
    assert number.evaluate("(cell) => cell.getBoundingClientRect().height > 50")  # lines of some 20 pixels
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize("scene", ["one", "three"])
def test_a_screen_on_a_wall_shows_all_without_scrolling(
    scene: str, serve: Serve, page: Page, request: pytest.FixtureRequest
) -> None:
    page.goto(serve(*request.getfixturevalue(scene), "--speed", "0.1"))
    expect(page.locator(".mass").first).to_be_visible(timeout=PATIENCE)
    assert page.evaluate("document.documentElement.scrollHeight") <= 1080
    for curves in page.locator(".plot:visible").all():
        ends = curves.evaluate(
            "(one) => [one, one.querySelector('canvas')].map((each) => each.getBoundingClientRect().bottom)"
        )
        assert ends[1] <= ends[0]


def test_phi_is_shown_when_asked_for(one: Options, serve: Serve, page: Page) -> None:
    page.goto(serve(*one))
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
    expect(page.locator("#phi")).to_be_hidden()
    page.get_by_role("button", name="φ").click()
    expect(page.locator("#phi .u-wrap")).to_be_visible()


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
    found = urlsplit(serve("--address", "0.0.0.0", *one))
    url = found._replace(netloc=f"127.0.0.1:{found.port}").geturl()
    bare, _, token = url.partition("?token=")
    assert len(token) >= 16
    for path in ("", "page.js", "drawings", "?token=", "?token=guessed", f"page.js?token={token[:-1]}"):
        with pytest.raises(HTTPError, match="403"):
            urlopen(bare + path)
    page.goto(url)
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
    page.goto(bare)  # by the cookie
    expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)


# Visible elements that look as if all were well: green ones, and curves or numbers in full colour.
_ALIVE = """() => [...document.querySelectorAll(".state, .well, .numbers, .uplot")]
    .filter((each) => each.checkVisibility())
    .filter((each) => (each.matches(".state, .well")
        ? [getComputedStyle(each).backgroundColor, getComputedStyle(each).color].includes("rgb(24, 128, 56)")
        : !getComputedStyle(each).filter.includes("grayscale") && !each.matches(".old")))
    .map((each) => each.className)"""


def test_nothing_looks_alive_once_the_observer_is_silent(silenced: Options, serve: Serve, page: Page) -> None:
    """Its inputs go on: the bus is busy, the clock goes."""
    page.goto(serve(*silenced))
    expect(page.locator(".state")).to_contain_text("OBSERVER SILENT", timeout=PATIENCE)
    expect(page.locator(".state")).to_have_css("background-color", RED)
    expect(page.locator(".fault")).to_contain_text("start `observer-rt run`")
    page.wait_for_function(f"({_ALIVE})().length === 0")


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_nothing_looks_alive_once_the_monitor_is_killed_or_hangs(
    one: Options, page: Page, tmp_path: Path, how: signal.Signals
) -> None:
    with served(command("monitor", "--port", "0", *one, "--speed", "0.02"), tmp_path) as monitor:
        page.goto(monitor.url)
        expect(page.locator(".mass")).to_be_visible(timeout=PATIENCE)
        assert page.evaluate(_ALIVE)
        monitor.process.send_signal(how)
        expect(page.get_by_text("No connection to observer-rt monitor since")).to_be_visible(timeout=PATIENCE)
        expect(page.locator(".state")).to_have_css("background-color", RED)
        assert page.evaluate(_ALIVE) == []
        monitor.process.send_signal(signal.SIGCONT)
        if how == signal.SIGSTOP:
            expect(page.get_by_text("No connection")).to_have_count(0, timeout=PATIENCE)
            page.wait_for_function(f"({_ALIVE})().length > 0")


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


def test_mass_and_curve_are_of_one_injection_in_every_frame(
    silenced: Options, serve: Serve, page: Page
) -> None:
    """Twenty come a second."""
    page.goto(serve(*silenced))
    page.evaluate(_TOGETHER)
    page.wait_for_function("window.seen.size >= 5", timeout=PATIENCE)
    for table, rate, *details in page.evaluate("[...window.seen.values()]"):
        assert rate == table
        assert len(set(details)) == 1


# Faults that end below the place they stand in, once there are five: at once, for the page goes on.
_CUT = """() => {
    const one = document.querySelector(".fault");
    for (let k = 0; k < 4; k++) one.after(one.cloneNode(true));
    const end = (each) => each.getBoundingClientRect().bottom;
    return [...one.parentElement.children].filter((each) => end(each) > end(one.parentElement) + 1).length;
}"""


def test_faults_are_shown_whole_however_many_and_wide(three: Options, serve: Serve, page: Page) -> None:
    page.goto(serve(*three))
    expect(page.locator(".fault", has_text="NeedleLiftBlock_two")).to_be_visible(timeout=PATIENCE)
    for width in (1920, 390):
        page.set_viewport_size({"width": width, "height": 844})
        cut = page.evaluate(_CUT)
        assert cut == 0


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
