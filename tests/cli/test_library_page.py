"""The programs of `docs/library.md`, run as printed."""

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from observer_rt.config.bench import load_injector
from observer_rt.recording.formats import write_recording
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate
from tests.pages import Page

PAGE = Page("docs/library.md")
PROGRAMS = PAGE.fenced("python")
NAMES = re.findall(r"^\|[^|]*\| `(observer_rt[\w.]+)` \| (.*) \|$", PAGE.text, flags=re.MULTILINE)


def printed(program: str, folder: Path) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


@pytest.mark.slow
def test_programs_do_what_the_page_says(tmp_path: Path) -> None:
    recorded, framed = PROGRAMS
    made = simulate(load_injector(), make_schedule([100e6], 3, 0.05, [1.1e-3]), 100e3, noise=SimulatedNoise())
    write_recording(tmp_path / "worn.csv", made.recording)
    lines = printed(recorded, tmp_path)
    assert [re.sub(r"\d+\.\d mg", "x mg", line) for line in lines] == [
        "1: x mg TOO_FEW_EVENTS",
        "2: x mg TOO_FEW_EVENTS",
        "3: x mg valid",
    ]
    assert printed(framed, tmp_path) == ["1 frame with a wrong CRC"]


def test_every_name_of_the_page_is_there() -> None:
    assert len(NAMES) > 8
    for module, names in NAMES:
        found = importlib.import_module(module)
        for name in re.findall(r"`(\w+)`", names):
            assert hasattr(found, name), f"{module}.{name}"
