"""The pages on databases and on buses: what they show is what the commands print and what the files say."""

import re
from pathlib import Path

import pytest

from tests.daemon.foreign_frames import classic_frames, fd_frames, multiplexed_frames
from tests.desk.cli.conftest import Command
from tests.device import simulated
from tests.files.canlog.log_cases import sent_log, write_log
from tests.pages import ROOT, Page

PAGE = Page("docs/dbc.md")
DATABASES = ROOT / "tests" / "bus" / "databases"
EXAMPLES = ("testbed_classic", "fast_daq_fd", "adc_multiplexed")
BUSES = (Page("docs/buses.md"), "three_buses")
CHECKED = [(PAGE, "testbed_classic"), BUSES]
QUOTED = [*((PAGE, name) for name in EXAMPLES), BUSES]
DEVICES = {
    "testbed_classic": (classic_frames, 10e3, 3),  # frames, samples a second, frames a sample
    "fast_daq_fd": (fd_frames, 50e3, 2 / 12),
    "adc_multiplexed": (multiplexed_frames, 50e3, 1),
}


def words(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize(("page", "name"), CHECKED)
def test_what_check_prints(page: Page, name: str, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(DATABASES)
    printed = words(command("check", "--bench", f"{name}.toml").out)  # a long finding takes several lines
    shown = [words(line) for line in page.shown(f"observer-rt check --bench {name}.toml")]
    assert len(shown) >= 5
    assert [line for line in shown if line not in printed] == []


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("fast_daq_fd", "needle_lift: FD_Needle 0x18FEF002, 12 samples a frame in mm, -1000 to 1000 um"),
        ("adc_multiplexed", "needle_lift: ADC_Data 0x500, 6 samples in 6 frames that take turns, in mm"),
    ],
)
def test_check_says_how_samples_come(
    name: str, said: str, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(DATABASES)
    assert said in words(command("check", "--bench", f"{name}.toml").out)


@pytest.fixture
def with_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder the user is in: databases, bench files, and a log of each bus."""
    for path in DATABASES.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    for name, (frames, rate, a_sample) in DEVICES.items():
        sent = enumerate(frames(simulated(rate=rate)))
        timed = (frame._replace(time=n / rate / a_sample) for n, frame in sent)
        write_log(tmp_path / f"{name}.log", sent_log(timed))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_log_of_the_bus_is_evaluated_and_replayed(name: str, command: Command, with_logs: Path) -> None:
    """Three injections of a nozzle that is 20 % too wide, of which the third is valid."""
    bench = ("--bench", f"{name}.toml")
    evaluated = command.done("evaluate", f"{name}.log", *bench).out
    assert "0 lost; 3 corrections adopted, 0 rejected" in words(evaluated)
    rows = re.findall(r"^ +\d .*? ([+-]\d+\.\d)% .*(yes|no)$", evaluated, re.MULTILINE)
    assert [float(nozzle) for nozzle, _ in rows] == [pytest.approx(20.0, abs=1.0)] * 3
    assert [valid for _, valid in rows] == ["no", "no", "yes"]
    on_bus = ("--interface", "virtual", "--channel", "try", "--speed", "0")
    frames = len(Path(f"{name}.log").read_text().splitlines())
    assert command.done("replay", f"{name}.log", *bench, *on_bus).out.startswith(f"{frames} frames in ")


@pytest.mark.parametrize(("page", "name"), QUOTED)
def test_the_files_say_what_the_page_quotes(page: Page, name: str) -> None:
    files = [DATABASES / f"{name}.toml", DATABASES / f"{name}.dbc"]
    text = "".join(path.read_text() for path in files if path.exists())
    before, _, after = page.text.partition(f"{name}.toml")
    section = before.rsplit("\n### ", 1)[-1] + after.split("\n#", 1)[0].split("    $ ", 1)[0]
    quoted = [line.strip() for line in section.splitlines() if line.startswith("    ")]
    assert len(quoted) > 5
    assert [line for line in quoted if line not in text] == []


def test_an_overlap(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (DATABASES / "testbed_classic.dbc").read_text()
    mistaken = text.replace("RP_SensorState : 55|2@0+", "RP_SensorState : 47|2@0+")
    assert mistaken != text
    (tmp_path / "testbed_classic.dbc").write_text(mistaken)
    bench = (DATABASES / "testbed_classic.toml").read_text()
    (tmp_path / "testbed_classic.toml").write_text(bench)
    monkeypatch.chdir(tmp_path)
    said = command.refused("run", "--bench", "testbed_classic.toml")
    shown = PAGE.shown("observer-rt run --bench testbed_classic.toml")
    assert [words(line) for line in shown] == [words(line) for line in said.splitlines() if line.strip()]
    monkeypatch.setenv("COLUMNS", "200")
    overlooked = "overlooked: testbed_classic.dbc: The signals RP_SensorState and RP_RailPressure"
    assert overlooked in command("check", "--bench", "testbed_classic.toml", "--lenient").out
    lenient = bench.replace('"testbed_classic.dbc"', '"testbed_classic.dbc"\nlenient = true', 1)
    (tmp_path / "testbed_classic.toml").write_text(lenient)
    assert overlooked in command("check", "--bench", "testbed_classic.toml").out
