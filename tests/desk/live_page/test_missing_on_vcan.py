"""The page of the missing effect beside a daemon on a real SocketCAN interface, pressed as its buttons do."""

import json
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import urlopen

import pytest
import tomlkit

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_injector
from observer_rt.desk.live_page.missing.word import FIRST_DELAY
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import write_recording
from observer_rt.model.effects import sized
from tests.daemon.end_to_end import START_TIMEOUT, command
from tests.daemon.participants import until
from tests.desk.live_page.browser import served

INJECTIONS = 18
SPEED = "0.25"
PATIENCE = 240.0  # s of a search, in a machine within a machine


@pytest.fixture
def bench(tmp_path: Path, vcan: str) -> Path:
    document: Any = tomlkit.parse(EXAMPLE_BENCH.read_text())
    document["link"]["channel"] = vcan
    document["learning"]["lockstep"] = True
    document["evidence"]["folder"] = "evidence"
    document["model"]["file"] = "injector.toml"
    shutil.copyfile(NOMINAL_INJECTOR, tmp_path / "injector.toml")
    path = tmp_path / "bench.toml"
    path.write_text(tomlkit.dumps(document))
    return path


class MissingPage:
    """The page by its addresses."""

    def __init__(self, url: str, word: str) -> None:
        self._url = f"{url}missing/"
        self._word = word

    @property
    def html(self) -> str:
        with urlopen(f"{self._url}now", timeout=START_TIMEOUT) as answer:
            return str(answer.read().decode())

    @property
    def gaps(self) -> list[tuple[str, float, str]]:
        """Validity, gap [MPa] and model of every injection drawn."""
        found = re.findall(
            r'class="(valid|refused)" x[^>]*><title>injection \d+: ([\d.]+) MPa, (\S+?)<', self.html
        )
        return [(kind, float(gap), model) for kind, gap, model in found]

    def has_finding(self) -> bool:
        """Whether something can be taken over; asked seldom, for the search has what time others leave it."""
        time.sleep(1.0)
        return "Take it over" in self.html

    def press(self, button: str, word: str | None = None) -> str:
        asked = urlencode({"button": button, "injector": "", "word": word or self._word}).encode()
        with urlopen(f"{self._url}press", asked, timeout=START_TIMEOUT) as answer:
            return str(answer.read().decode())


@contextmanager
def monitor_of(bench: Path) -> Iterator[MissingPage]:
    with served(command("monitor", "--port", "0", "--bench", bench)) as monitor:
        assert monitor.process.stderr is not None
        told = monitor.process.stderr.readline()
        assert "wants the word" in told
        yield MissingPage(monitor.url, told.split()[-1])


@contextmanager
def daemon_of(bench: Path) -> Iterator[Path]:
    """A daemon that is ready; gives its log."""
    log = bench.with_name("observer.log")
    with subprocess.Popen(command("run", "--bench", bench, "--log", log)) as daemon:
        try:
            until(lambda: log.exists() and ": ready\n" in log.read_text(), START_TIMEOUT)
            yield log
        finally:
            daemon.send_signal(signal.SIGTERM)


@pytest.mark.slow
@pytest.mark.vcan
def test_what_is_missing_is_found_taken_over_and_undone_on_the_page(bench: Path, tmp_path: Path) -> None:
    schedule = make_schedule([60e6, 100e6, 140e6], INJECTIONS, 60e-3, [0.9e-3, 1.9e-3])
    hidden = (sized("rail_pressure_sensor_gain", g=0.02),)
    measured = simulate(load_injector(), schedule, 100e3, hidden, SimulatedNoise(), seed=5)
    write_recording(tmp_path / "injections.csv", measured.recording)
    replay = command("replay", tmp_path / "injections.csv", "--bench", bench, "--speed", SPEED)

    with daemon_of(bench) as log, monitor_of(bench) as page:
        subprocess.run(replay, check=True, timeout=PATIENCE)
        until(lambda: len(page.gaps) == INJECTIONS, START_TIMEOUT)
        until(lambda: re.search(r"<b>1[0-9]</b> events refused", page.html) is not None, START_TIMEOUT)
        before = page.gaps
        assert {model for *_, model in before} == {"injector.toml"}
        assert "valid" not in {kind for kind, *_ in before[-6:]}

        with pytest.raises(HTTPError, match="403"):
            page.press("search", "guessed")
        time.sleep(FIRST_DELAY)
        page.press("search")
        until(page.has_finding, PATIENCE)
        assert "rail_pressure_sensor_gain" in page.html
        assert load_injector(tmp_path / "injector.toml").effects == ()  # nothing happens by itself

        assert "the observer has it in force" in page.press("take_over")
        until(lambda: log.read_text().count(": ready\n") == 2, START_TIMEOUT)
        subprocess.run(replay, check=True, timeout=PATIENCE)
        until(lambda: len(page.gaps) == 2 * INJECTIONS, START_TIMEOUT)
        after = page.gaps[INJECTIONS:]
        assert {model for *_, model in after} == {"injector_amended_1.toml"}
        assert {kind for kind, *_ in after[2:]} == {"valid"}
        assert max(gap for _, gap, _ in after) < 0.3 * max(gap for _, gap, _ in before)
        (found,) = load_injector(tmp_path / "injector_amended_1.toml").effects
        assert found.parameters["g"].value == pytest.approx(0.02, abs=0.001)

        page.press("undo")
        until(lambda: log.read_text().count(": ready\n") == 3, START_TIMEOUT)
        assert "<b>injector.toml</b>" in page.html
    with (tmp_path / "evidence" / "missing" / "findings.json").open() as findings:
        assert json.load(findings)["verdict"] == "named"
