"""The live page with a daemon at work, and a bare page beside it in the same run."""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from playwright.sync_api import Browser, sync_playwright
from rich.table import Table

from tests.desk.live_page.browser import Served, launch, served
from tools.benchmarks.command_line import JsonOption, app
from tools.benchmarks.live_page import bare_page
from tools.benchmarks.live_page.watched import Gaps, Watched, watch
from tools.benchmarks.report import list_of, put_out
from tools.benchmarks.speed import native
from tools.benchmarks.speed.injectors import in_windows, socket_bench, until_all_ready
from tools.benchmarks.speed.observers import RUN, observer
from tools.benchmarks.speed.pace import Passage, socket_pacer
from tools.benchmarks.speed.sustained import socket_pair
from tools.benchmarks.speed.traffic import SAMPLE_RATE, SAMPLES, Traffic, make_traffic

PER_SECOND = 30  # injections
LONGEST = 100.0  # ms between frames with something new, at the most
RATE_PANEL = "rate_0"
_EVENTS = 27  # 0.9 s, a whole number of frames
_SETTLING = 5.0  # s: the daemon learns, the browser compiles what it runs often
_CLOSING = 5.0  # s that frames still come when the page is closed
_FRAME = SAMPLES / SAMPLE_RATE  # s
_MONITOR = (sys.executable, "-m", "observer_rt", "monitor", "--port", "0", "--bench")


@dataclass(frozen=True)
class SocketBus:
    """A bus with a place for the devices, the daemon and a listener."""

    devices: socket.socket
    daemon: socket.socket
    listener: socket.socket


class Hub:
    """What connects the sockets of some buses."""

    def __init__(self, process: subprocess.Popen[str], ends: list[list[int]]) -> None:
        self._process = process
        self._listeners = [each[-1] for each in ends]

    def lost_to_listeners(self) -> int:
        """Frames so far that listeners were too late for."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("?")
        self._process.stdin.flush()
        numbers = list(map(int, self._process.stdout.readline().split()))
        lost = dict(zip(numbers[::2], numbers[1::2], strict=True))
        return sum(lost[each] for each in self._listeners)


@contextmanager
def socket_buses(folder: Path, count: int) -> Iterator[tuple[list[SocketBus], Hub]]:
    """So many buses. Raises UserError without a C compiler."""
    with ExitStack() as stack:
        pairs = [[socket_pair(stack) for _ in range(3)] for _ in range(count)]
        ends = [[pair.receiver.fileno() for pair in each] for each in pairs]
        words = [native.program("hub", folder), *(",".join(map(str, each)) for each in ends)]
        process = stack.enter_context(
            subprocess.Popen(
                list(map(str, words)),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                pass_fds=[number for each in ends for number in each],
            )
        )
        buses = [SocketBus(*(pair.sender for pair in each)) for each in pairs]
        yield buses, Hub(process, ends)
        assert process.stdin is not None
        process.stdin.close()


@dataclass(frozen=True)
class LivePage:
    """Both pages. lost_frames: that came too fast for the listener; load: of the machine before."""

    injectors: int
    ours: Watched
    bare: Watched
    lost_frames: int
    load: float

    @property
    def drawn(self) -> Gaps:
        """Of the panel with the injection rate."""
        return self.ours.drawn[RATE_PANEL]

    @property
    def is_met(self) -> bool:
        """Whether that is smooth enough."""
        return self.drawn.longest <= LONGEST

    @property
    def bare_drawn(self) -> Gaps:
        """Of the line of the bare page."""
        return self.bare.drawn[bare_page.NAME]

    @property
    def seen_share(self) -> float:
        """Injections the page went through, of those that were sent."""
        return min(self.ours.numbers, default=0) / (self.ours.seconds * PER_SECOND)


def measure_page(folder: Path, seconds: float, injectors: int) -> LivePage:
    """Watch both pages for so long [s] each; the daemon goes on meanwhile. Raises RunError, UserError."""
    load = os.getloadavg()[0]
    traffic = make_traffic(folder, 1.0 / PER_SECOND, _EVENTS)
    if injectors > 1:  # no bus carries several at 100 kHz
        traffic = in_windows(traffic)
    with ExitStack() as stack:
        buses, hub = stack.enter_context(socket_buses(folder, injectors))
        on_air = _Traffic(folder, traffic, buses)
        daemon_ends = [bus.daemon for bus in buses]
        bench = socket_bench(folder / "daemon", daemon_ends)
        ours = stack.enter_context(observer([*RUN, bench], [each.fileno() for each in daemon_ends]))
        until_all_ready(ours, injectors)
        listener_ends = [bus.listener for bus in buses]
        command: list[str | Path] = [*_MONITOR, socket_bench(folder / "monitor", listener_ends)]
        browser = launch(stack.enter_context(sync_playwright()))
        stack.callback(browser.close)
        with served(command, folder, [each.fileno() for each in listener_ends]) as page:
            found = on_air.while_watched(browser, page, seconds)
            lost = hub.lost_to_listeners()
        bare = [sys.executable, "-m", bare_page.__name__, str(round(1e3 / PER_SECOND))]
        with served(bare) as page:
            beside = on_air.while_watched(browser, page, seconds)
    return LivePage(injectors, found, beside, lost, load)


class _Traffic:
    """What devices send, to all injectors in turn."""

    def __init__(self, folder: Path, traffic: Traffic, buses: Sequence[SocketBus]) -> None:
        self._pacers = [
            socket_pacer(folder, traffic, bus.devices, round(place / len(buses) / PER_SECOND / _FRAME))
            for place, bus in enumerate(buses)
        ]

    def while_watched(self, browser: Browser, page: Served, seconds: float) -> Watched:
        """Send, and watch a page meanwhile."""
        count = round((_SETTLING + seconds + _CLOSING) / _FRAME)
        sending: list[Future[Passage]] = []
        with ThreadPoolExecutor(len(self._pacers)) as together:

            def begin() -> None:
                sending.extend(together.submit(pacer.send, count, _FRAME) for pacer in self._pacers)

            found = watch(browser, page, begin, _SETTLING, seconds)
            for each in sending:
                each.result()
        return found


def page_document(found: LivePage) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    return {
        "figures": {
            "longest_gap_ms": found.drawn.longest,
            "longest_gap_bar_ms": LONGEST,
            "is_met": found.is_met,
            "p99_gap_ms": found.drawn.p99,
            "median_gap_ms": found.drawn.median,
            "bare_longest_gap_ms": found.bare_drawn.longest,
            "injections_seen_share": found.seen_share,
            "lost_frames": found.lost_frames,
            "server_cpu": found.ours.server_cpu,
            "browser_cpu": found.ours.browser_cpu,
        },
        "details": asdict(found),
    }


def page_table(found: LivePage) -> Table:
    """Both pages; gaps are longest / 99 % / median."""
    verdict = "met" if found.is_met else "MISSED"
    title = (
        f"live page, {found.injectors} x {PER_SECOND} injections a second, {found.ours.seconds:.0f} s, load before "
        f"{found.load:.1f}\nlongest gap {found.drawn.longest:.0f} ms, bar {LONGEST:.0f}: {verdict}; "
        f"{100.0 * found.seen_share:.0f} % of the injections seen, {found.lost_frames} frames lost"
    )
    pages = {"observer_rt monitor": found.ours, "uPlot, one line": found.bare}
    rows = [
        [
            (f"{name}: made at all", page.made, page.server_cpu, page.browser_cpu),
            *((f"  {panel} drawn anew", gaps, None, None) for panel, gaps in page.drawn.items()),
        ]
        for name, page in pages.items()
    ]
    columns = {
        "": "{[0]}",
        "frames a second": "{[1].per_second:.1f}",
        "gaps, ms: longest / 99 % / median": "{[1]}",
        "server CPU": "{[2]:.2f}",
        "browser CPU": "{[3]:.2f}",
    }
    return list_of(title, rows, columns)


@app.command(epilog="Examples: tools/bench monitor; tools/bench monitor --injectors 3 --seconds 20")
def monitor(
    seconds: Annotated[float, typer.Option(min=1.0, help="How long each page is watched.")] = 60.0,
    injectors: Annotated[int, typer.Option(min=1, max=8, help="Side by side, each on a bus.")] = 1,
    as_json: JsonOption = False,
) -> None:
    """How smoothly the live page is drawn in a real browser, beside a bare page; exit code 1 where it is not."""
    with tempfile.TemporaryDirectory(prefix="monitor-") as folder:
        found = measure_page(Path(folder), seconds, injectors)
    put_out(as_json, page_document(found), [page_table(found)], 120)
    if not found.is_met:
        raise typer.Exit(1)
