"""The registry of formats: one from outside works in every command, one that will not do is told, the page agrees."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.canlog.can_log import LogFormat
from observer_rt.files.formats import BUILT_IN, formats, is_log, open_log, read_recording
from observer_rt.files.replay.log_frames import LogPart
from observer_rt.foundation.errors import UserError
from tests.desk.cli.conftest import Command, document
from tests.device import frames_of
from tests.files.canlog.log_cases import moved, sent_log, write_log

PAGE = Path(__file__).parents[3] / "docs" / "recordings.md"
LOG = """
from observer_rt.files.canlog.candump import CandumpLog, CandumpWriter
from observer_rt.files.canlog.can_log import LogFormat

FORMAT = LogFormat((".hexlog",), "text of another tool", CandumpLog, CandumpWriter)
"""
SIGNALS = """
import numpy as np

from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.signal_format import SignalFormat

def read(path):
    return Recording(*np.load(path), path=path)

def write(path, recording):
    with path.open("wb") as file:
        np.save(file, np.stack((recording.time, *recording.signals.values())))

FORMAT = SignalFormat((".samples",), "array of numpy", read, write)
"""
Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Put a distribution beside ours whose entry point leads to `FORMAT` of a module with this text."""

    def installed(name: str, text: str) -> None:
        site = tmp_path / "site"
        metadata = site / f"{name}-1.2.dist-info"
        metadata.mkdir(parents=True)
        (site / f"{name}.py").write_text(text)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        (metadata / "entry_points.txt").write_text(f"[observer_rt.formats]\nmine = {name}:FORMAT\n")
        monkeypatch.syspath_prepend(site)
        formats.cache_clear()

    yield installed
    formats.cache_clear()


def test_a_log_format_from_outside(
    command: Command, install: Install, tmp_path: Path, worn: Path, bench: Path
) -> None:
    install("hex_of_others", LOG)
    frames = sent_log(frames_of(bench, worn))
    log, blf = tmp_path / "bus.hexlog", tmp_path / "bus.blf"
    write_log(blf, frames)
    command.done("convert", blf, log)
    assert is_log(log)
    assert moved(open_log(log), [frame._replace(channel="can0") for frame in frames]) < 2000
    assert LogPart(log).extent().frames == len(frames)  # what `replay` sends
    ours, theirs = (document(command, path, "--bench", bench)["recordings"][0] for path in (blf, log))
    assert theirs["injections"] == ours["injections"] != []


def test_a_recording_format_from_outside(
    command: Command, install: Install, tmp_path: Path, worn: Path
) -> None:
    install("arrays", SIGNALS)
    path = tmp_path / "worn.samples"
    command.done("convert", worn, path)
    np.testing.assert_array_equal(read_recording(path).line_pressure, read_recording(worn).line_pressure)
    ours, theirs = (document(command, each)["recordings"][0] for each in (worn, path))
    assert theirs["injections"] == ours["injections"] != []


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("import nosuchmodule", "cannot be loaded: ModuleNotFoundError"),
        ("FORMAT = 3", "is a int, neither LogFormat nor SignalFormat"),
        (
            LOG.replace(".hexlog", "HEX"),
            "has the suffixes ('HEX',): each begins with a dot and is in lower case",
        ),
        (LOG.replace(".hexlog", ".blf"), "has the suffix .blf, which belongs to 'Vector, binary'"),
        (LOG.replace(".hexlog", ".csv"), "has the suffix .csv, which belongs to 'time_s,"),
        (SIGNALS.replace(".samples", ".trc"), "has the suffix .trc, which belongs to 'PEAK"),
    ],
)
def test_a_format_that_will_not_do_names_its_distribution(
    command: Command, install: Install, resting: Path, tmp_path: Path, text: str, problem: str
) -> None:
    name = tmp_path.name  # a module of its own
    install(name, text)
    said = command.refused("evaluate", resting)
    assert f"format 'mine' of {name} 1.2: {name}:FORMAT {problem}" in said
    assert "remedy: mend it, or uninstall that distribution" in said
    with pytest.raises(UserError):
        formats()


def test_the_page_lists_the_formats_of_the_registry() -> None:
    row = re.compile(r"^\| (`\.[^|]+`) \| ([^|]+) \|(?: (yes|no) \|)?$", re.MULTILINE)
    told = {
        (suffix, match[2], match[3] == "yes")
        for match in row.finditer(PAGE.read_text(encoding="utf-8"))
        for suffix in re.findall(r"`(\.[\w.]+)`", match[1])
    }
    assert told == {
        (suffix, each.description, isinstance(each, LogFormat) and each.recorder is not None)
        for each in BUILT_IN
        for suffix in each.suffixes
    }


def test_the_help_lists_the_formats_of_the_registry(command: Command) -> None:
    text = " ".join(command("convert", "--help").out.split())
    recordings, logs = ".csv, .mf4, .parquet, .txt, .csv.gz, .txt.gz", ".log, .blf, .asc, .trc, .mf4, .csv"
    assert f"Recording ({recordings}) or CAN log ({logs})." in text
    assert "no CAN FD in .trc" in text
    assert "Log to write (.log, .blf)" in " ".join(command("record", "--help").out.split())
