"""A page in a real browser, watched for a while: when frames were made, and when something new was drawn."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
from playwright.sync_api import Browser, Page

from tests.desk.live_page.browser import Served
from tests.plants.arrays import Array
from tools.benchmarks.speed.observers import cpu_time

_FRAMES = Path(__file__).with_name("frames.js").read_text("utf-8")
_PATIENCE = 120_000  # ms until a page shows its first injection
_NUMBER = ".letters tr:has(th:text-is('injection')) td"


@dataclass(frozen=True)
class Gaps:
    """Times between frames [ms], and how many frames there were a second."""

    longest: float
    p99: float
    median: float
    per_second: float

    @classmethod
    def of(cls, times: Array, begin: float, end: float) -> "Gaps":
        """Of frames at some times [ms], in a stretch of time."""
        within = times[(times > begin) & (times < end)]
        gaps = np.diff(within, prepend=begin, append=end)
        p99, median = np.quantile(gaps, (0.99, 0.5))
        return cls(float(gaps.max()), float(p99), float(median), 1e3 * within.size / (end - begin))

    def __str__(self) -> str:
        return f"{self.longest:.0f} / {self.p99:.0f} / {self.median:.0f}"


@dataclass(frozen=True)
class Watched:
    """A page. made: frames the browser made at all; drawn: those with something new, by the name of the figure.

    numbers: of injections that it went through, of each injector; shares of one core.
    """

    seconds: float
    made: Gaps
    drawn: dict[str, Gaps]
    numbers: tuple[int, ...]
    server_cpu: float
    browser_cpu: float


def watch(
    browser: Browser, served: Served, begun: Callable[[], None], settling: float, seconds: float
) -> Watched:
    """Open the page; begin with what it shows; once that has settled [s], watch it for so long [s]."""
    page = browser.new_page(viewport={"width": 1920, "height": 1080})
    try:
        page.add_init_script(_FRAMES)
        page.goto(served.url)
        page.wait_for_selector(".uplot", timeout=_PATIENCE)
        begun()
        page.wait_for_timeout(1e3 * settling)
        begin, first, busy = _now(page), _numbers(page), _cpu_times(served)
        page.wait_for_timeout(1e3 * seconds)
        end, last, busy_then = _now(page), _numbers(page), _cpu_times(served)
        found = page.evaluate("window.framesOf()")
    finally:
        page.close()
    took = 1e-3 * (end - begin)
    server, browsing = ((after - before) / took for before, after in zip(busy, busy_then, strict=True))
    return Watched(
        took,
        Gaps.of(np.array(found["made"]), begin, end),
        {name: Gaps.of(np.array(each), begin, end) for name, each in found["drawn"].items()},
        tuple(after - before for before, after in zip(first, last, strict=True)),
        server,
        browsing,
    )


def _now(page: Page) -> float:
    return float(page.evaluate("performance.now()"))


def _numbers(page: Page) -> list[int]:
    """Of the injections shown, of every injector."""
    texts = page.locator(_NUMBER).all_inner_texts()
    return [int(found[0]) for text in texts if (found := re.match(r"\d+", text))]


def _cpu_times(served: Served) -> tuple[float, float]:
    """Processor time so far [s]: of the server, of all processes of the browser."""
    own = psutil.Process()
    browsing = [each for each in own.children(recursive=True) if "chrom" in each.name()]
    return cpu_time(psutil.Process(served.process.pid)), sum(map(cpu_time, browsing))
