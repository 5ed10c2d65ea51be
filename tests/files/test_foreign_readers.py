"""What we write, opened by others as docs/measurement-tools.md says: asammdf, python-can with cantools, pandas."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import can
import cantools.database
import numpy as np
import pytest
from asammdf import MDF
from cantools.database.can import Database

from observer_rt.config.bench import load_bench
from observer_rt.files.formats import open_log, open_writer
from tests.daemon.participants import bench_file
from tests.device import frames_of, worn_recording
from tests.files.traffic import BEGIN, ObservedInjector, traffic, write_log
from tests.pages import ROOT, Page

DATABASE = ROOT / "dbc" / "observer_fd.dbc"
NO_RATE = 555.34  # mm3/ms, beyond which lies the code for it


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four injections of a worn injector on a bus, inputs and results."""
    folder = tmp_path_factory.mktemp("foreign")
    bench = load_bench(bench_file(folder, "can0", "socketcan"))
    recording = worn_recording(4)
    frames = frames_of(bench, recording)
    write_log(folder / "bus.log", list(traffic(frames, [ObservedInjector(bench)])), ["can0"])
    return folder / "bus.log"


def converted(log: Path, suffix: str) -> Path:
    """The same log in another format."""
    path = log.with_suffix(suffix)
    if not path.exists():
        with open_writer(path, BEGIN) as writer:
            for frame in open_log(log):
                writer.write(frame)
    return path


def decoded(messages: Iterator[can.Message], name: str) -> list[dict[str, float]]:
    """The values of every frame of a message, as cantools knows it."""
    database = cantools.database.load_file(DATABASE)
    assert isinstance(database, Database)
    wanted = database.get_message_by_name(name)
    return [
        wanted.decode(message.data, decode_choices=False)
        for message in messages
        if message.arbitration_id == wanted.frame_id
    ]


def test_asammdf_decodes_a_log_by_our_database(log: Path) -> None:
    with can.LogReader(log) as reader:
        expected = decoded(iter(reader), "InjectionRate")
    with MDF(converted(log, ".mf4")) as file:
        signals = file.extract_bus_logging(database_files={"CAN": [(str(DATABASE), 0)]})
        for name in ("InjectionRate_00", "InjectionRate_27"):
            rate = signals.get(name)
            assert rate.unit == "mm3/ms"
            assert np.nanmax(rate.samples) > 50
            values = np.array([frame[name] for frame in expected])
            values[values > NO_RATE] = np.nan
            assert np.isnan(values[0])  # before the observer has settled
            np.testing.assert_allclose(rate.samples, values, atol=0.006)
        assert signals.get("Mass").unit == "mg"


def test_the_programs_of_the_page(log: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In a folder with the log and our databases: asammdf first, python-can with cantools then."""
    (tmp_path / "dbc").symlink_to(ROOT / "dbc")
    for suffix in (".mf4", ".blf"):
        (tmp_path / f"bus{suffix}").write_bytes(converted(log, suffix).read_bytes())
    monkeypatch.chdir(tmp_path)
    of_signals, of_masses = (
        subprocess.run([sys.executable, "-c", each], capture_output=True, text=True, check=True).stdout
        for each in Page("docs/measurement-tools.md").fenced("python")
    )
    assert of_signals.startswith("mm3/ms [")
    numbers = [line.split()[0] for line in of_masses.splitlines()]
    assert numbers == ["1", "2", "3", "4"]
    assert "1 not valid: TOO_FEW_EVENTS" in of_masses
    assert float(of_masses.splitlines()[-1].split()[1]) > 10
