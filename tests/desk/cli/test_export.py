"""`observer-rt export`: what is written, and what it refuses with a remedy."""

import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from observer_rt.desk.export import command as module
from observer_rt.desk.export import fmu
from observer_rt.desk.export.c_code import c_sources
from tests.desk.cli.conftest import Command, document
from tests.desk.cli.injector_files import injector
from tests.desk.export.exported import TERMS, WORN
from tests.pages import Page


def test_everything_at_once(command: Command, tmp_path: Path, worn: Path) -> None:
    state, model = tmp_path / "learned.json", tmp_path / "injector.toml"
    injector(model, end=WORN)
    document(command, worn, "--model", model, "--save-state", state)
    folders = {name: tmp_path / name for name in ("c", "fmu", "matlab")}
    options = [word for name, path in folders.items() for word in (f"--{name}", path)]
    outcome = command.done("export", *options, "--json", "--model", model, "--state", state)
    printed = json.loads(outcome.out)
    assert printed["name"] == "injector"
    assert printed["phi_version"] > 0
    assert "learned state restored" in outcome.err
    assert "replayed: observer within" in outcome.err
    assert "with a library for this machine" in outcome.err
    assert {path.name for path in folders["fmu"].iterdir()} == {
        f"{name}_fmi{version}.fmu" for name in ("observer", "injector") for version in (2, 3)
    }
    assert {path.name for path in folders["matlab"].iterdir()} == {
        "injector_coefficients.m",
        "injector_rates.m",
    }
    rows = (folders["c"] / "observer_outputs.csv").read_text().splitlines()
    assert rows[0].startswith("time_s,is_valid,is_open,injection_rate_m3_per_s,")
    assert len(rows) > 10_000
    assert "#define OBSERVER_SINGLE 0" in (folders["c"] / "parameters.h").read_text()
    said = command.refused("export", *options, "--model", model)
    assert "exists already" in said
    command.done(
        "export", "--c", folders["c"], "--single", "--sample-rate", "50e3", "--model", model, "--force"
    )
    header = (folders["c"] / "parameters.h").read_text()
    assert "#define OBSERVER_SINGLE 1" in header
    assert "#define SAMPLE_INTERVAL R(2e-05)" in header


def test_fuel_of_another_temperature(command: Command, tmp_path: Path) -> None:
    model = tmp_path / "injector.toml"
    injector(model)
    flows = []
    for celsius in (40.0, 80.0):
        printed = command.done("export", "--json", "--model", model, "--fuel-temperature", celsius).out
        numbers = {one["name"]: one["value"] for one in json.loads(printed)["coefficients"]}
        flows.append(numbers["nozzle_flow"])
    assert flows[1] / flows[0] == pytest.approx((1.0 - 40 * 7e-4) ** -0.5)


def test_without_a_compiler(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "compiler", lambda: None)
    monkeypatch.setattr(fmu, "compiler", lambda: None)
    outcome = command.done("export", "--c", tmp_path / "c", "--fmu", tmp_path / "fmu")
    assert "injector_fmi3.fmu, as sources: there is no C compiler here" in outcome.err
    assert "no C compiler here: the reference runs were not replayed" in outcome.err
    assert (tmp_path / "c" / "replay.c").exists()


def test_sources_that_differ_are_told(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = c_sources

    def wrong(*arguments: object) -> dict[str, str]:
        sources = dict(right(*arguments))  # type: ignore[arg-type]
        sources["model.c"] = sources["model.c"].replace(
            "R(1.0) + nozzle_change", "R(1.000001) + nozzle_change"
        )
        return sources

    monkeypatch.setattr(module, "c_sources", wrong)
    outcome = command("export", "--c", tmp_path / "c")
    assert outcome.code == 1
    assert "differs from ours" in outcome.err


def test_what_is_refused(command: Command, tmp_path: Path, bench: Path) -> None:
    model = tmp_path / "injector.toml"
    assert "nothing is asked for" in command.refused("export")
    assert "--single: is of the C sources" in command.refused("export", "--json", "--single")
    assert "no such file" in command.refused("export", "--json", "--state", tmp_path / "none.json")
    text = bench.read_text()
    bench.write_text(text.replace('meaning = "instant"', 'meaning = "mean"'))
    assert "is 'mean', but an export takes values at an instant" in command.refused(
        "export", "--json", "--bench", bench
    )
    bench.write_text(text.replace("[signals.needle_lift]", "[signals.needle_lift]\nlag_us = 20"))
    assert "signals.needle_lift: states a delay or a lag" in command.refused(
        "export", "--json", "--bench", bench
    )
    bench.write_text(
        text.replace('training = "prediction_error"', 'training = "paper"\nidentification_gain = 1e5')
    )
    assert "'paper' carries another phi" in command.refused("export", "--json", "--bench", bench)
    injector(model)
    assert "integration steps a sample" in command.refused(
        "export", "--json", "--model", model, "--sample-rate", "1000"
    )


def test_the_page(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, worn: Path) -> None:
    """Its commands, its example in C, and the one for FMPy."""
    page = Page("docs/export.md")
    monkeypatch.chdir(tmp_path)
    shutil.copy(worn, "worn.csv")
    Path("injector.toml").write_text(command("run", "--print-example-injector").out)
    for line in page.commands[1:]:
        command.done(*shlex.split(line)[1:])
    (replay,) = (block for block in page.indented() if block.startswith("cd ecu"))
    done = subprocess.run(["bash", "-c", replay], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "samples compared" in done.stdout
    (example,) = page.fenced("c")
    Path("ecu/example.c").write_text(example)
    flags = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-c", "-o", "example.o", "example.c")
    subprocess.run(["cc", *flags], cwd="ecu", check=True)
    (program,) = page.fenced("python")
    shown = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert float(shown) == pytest.approx(5e6)  # that of the chamber: nothing was put in


def test_a_state_of_another_model(command: Command, tmp_path: Path, worn: Path) -> None:
    state, model = tmp_path / "learned.json", tmp_path / "injector.toml"
    document(command, worn, "--save-state", state)
    injector(model, end=TERMS)
    assert "learned.json" in command.refused("export", "--json", "--model", model, "--state", state)
