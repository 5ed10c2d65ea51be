"""`observer-rt compare`: two runs of `discover`, from the files they wrote."""

import json
import re
from pathlib import Path

import pytest

from tests.cli.conftest import Command


@pytest.mark.slow
def test_wear_grew_from_one_run_to_the_next(command: Command, tmp_path: Path) -> None:
    folders = []
    for name, v_h in (("spring", 0.1), ("autumn", 0.2)):
        recording, folder = tmp_path / f"{name}.csv", tmp_path / name
        command("simulate", "--injections", 4, "--effect", f"orifice_area={v_h}", "--output", recording)
        command.done("discover", "--out", folder, recording)
        folders.append(folder)
    done = command.done("compare", *folders)
    assert "one operating point, nothing held out" in done.out
    assert "spring.csv" in done.out
    assert re.search(r"orifice_area v_H: \+0\.\d+ ± 0\.0\d+ \(95 %\), changed", done.out)
    (change,) = json.loads(command("compare", "--json", *folders).out)["changes"]
    assert change["significant"]
    assert change["ci95"][0] < 0.1 < change["ci95"][1]


def test_one_run_or_none_is_refused(command: Command, tmp_path: Path) -> None:
    assert "two folders" in command("compare", tmp_path).err
    assert "findings.json: no such file" in command.refused("compare", tmp_path, tmp_path)
