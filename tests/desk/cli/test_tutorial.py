"""The page of a first hour, and the README's: commands without a bus and program as they stand, in order."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command
from tests.desk.cli.test_pages import run_all, without_bus
from tests.pages import Page

PAGE, README = Page("docs/tutorial.md"), Page("README.md")
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?")


@pytest.mark.slow
def test_the_first_hour(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    simulate, evaluate, *own, discover, amended, example, check = without_bus(PAGE)
    run_all(command, [simulate])
    printed, shown = indented(command, evaluate), PAGE.shown(evaluate)
    assert len(shown) == 6
    for line, said in zip(printed[printed.index(shown[0]) :], shown, strict=False):
        assert NUMBER.sub("", line).split() == NUMBER.sub("", said).split()
        # what was learned differs in its last digit from version to version
        assert [*map(float, NUMBER.findall(line))] == pytest.approx([*map(float, NUMBER.findall(said))], 1e-3, 0.2)
    (program,), (layout,) = PAGE.fenced("python"), PAGE.fenced("toml")
    subprocess.run([sys.executable, "-c", program], check=True)
    Path("mine.toml").write_text(layout)
    run_all(command, own)
    assert Path("mine.png").exists()
    assert set(PAGE.shown(discover)) <= set(indented(command, discover))
    rows = [line for line in indented(command, amended) if line.endswith("yes")]
    assert len(rows) == 12
    assert all(abs(float(re.findall(r"([+-]\d+\.\d)%", row)[0])) < 1.0 for row in rows)
    Path("worn.png").unlink()
    run_all(command, [example, check, *(line for line in without_bus(README) if line not in without_bus(PAGE))])
    assert Path("found/report.html").exists()
    assert Path("worn.png").exists()


def indented(command: Command, line: str) -> list[str]:
    return [f"    {each}".rstrip() for each in command.done(*line.split()[1:]).out.splitlines()]
