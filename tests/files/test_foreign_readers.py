"""What we write, opened by others as docs/measurement-tools.md says: asammdf, python-can with cantools."""

import subprocess
import sys
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.replay.framing import TimedFrame
from tests.daemon.participants import bench_file
from tests.device import worn_recording
from tests.files.canlog.log_cases import sent_log, write_log
from tests.pages import ROOT, Page


def test_the_programs_of_the_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In a folder with our databases, and four injections of a worn injector in two formats: both say the same."""
    sent = evaluate(load_bench(bench_file(tmp_path, "can0", "socketcan")), [worn_recording(4)]).frames
    log = sent_log(TimedFrame(n * 1e-5, f.frame_id, f.is_extended, f.is_fd, f.payload) for n, f in enumerate(sent))
    for suffix in (".mf4", ".blf"):
        write_log(tmp_path / f"bus{suffix}", log)
    (tmp_path / "dbc").symlink_to(ROOT / "dbc")
    monkeypatch.chdir(tmp_path)
    of_signals, of_masses = (
        subprocess.run([sys.executable, "-c", each], capture_output=True, text=True, check=True).stdout
        for each in Page("docs/measurement-tools.md").fenced("python")
    )
    unit, _, samples = of_signals.partition(" [")
    masses, rows = samples.strip(" ]\n").split(), [row.split() for row in of_masses.splitlines()]
    assert (unit, [row[0] for row in rows]) == ("mm3/ms", ["1", "2", "3", "4"])
    assert float(masses[-1]) == pytest.approx(float(rows[-1][1]), abs=0.006)
    assert float(masses[-1]) > 10
