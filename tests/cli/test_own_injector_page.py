"""The page on an injector of one's own: its commands as a new user types them, and what it says of their results."""

import csv
import json
from pathlib import Path

import pytest

from observer_rt.config.bench import load_injector
from tests.cli.conftest import Command, document
from tests.own_injector import PAGE, PRINT_BENCH, change_bench, write_files
from tests.pages import needs_bus, words_of


@pytest.mark.slow
def test_the_page(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_files(tmp_path)
    for line in PAGE.commands:
        if line.startswith(("sudo", "tools/vcan")) or needs_bus(line):
            continue  # tests/service/test_on_vcan_pages.py
        words, into = words_of(line)
        outcome = command.done(*words)
        if into is not None:
            into.write_text(outcome.out)
        if line == PRINT_BENCH:
            change_bench(tmp_path / "bench.toml")
        elif words[:2] == ["check", "--bench"]:
            assert "fitted.toml: adequate" in " ".join(outcome.out.split())
    the_fit_is_as_the_page_says()
    the_worn_injector_is(
        document(command, "worn.csv", "--model", "fitted.toml")["recordings"][0]["injections"]
    )
    assert json.loads(Path("found/findings.json").read_text())["verdict"] == "named"


def the_fit_is_as_the_page_says() -> None:
    plant, by_file, fitted = (
        load_injector(Path(name)) for name in ("plant.toml", "by_file.toml", "fitted.toml")
    )
    for found in (by_file, fitted):
        assert (found.line_outflow, found.line.model) == (plant.line_outflow, plant.line.model)
        assert found.baseline is not None
        assert found.baseline.adequate
    assert by_file.line.diameter == 2.4e-3
    assert fitted.line.diameter == pytest.approx(plant.line.diameter, rel=0.005)
    assert fitted.nozzle.flow_coefficient == pytest.approx(plant.nozzle.flow_coefficient, rel=0.01)
    assert fitted.fluid.bulk_modulus_line == pytest.approx(plant.fluid.bulk_modulus_line, rel=0.01)


def the_worn_injector_is(injections: list[dict[str, float]]) -> None:
    """Every mass from the third on, beside the truth."""
    assert [bool(one["valid"]) for one in injections] == [False, False, *[True] * 4]
    with Path("worn.csv.truth.csv").open() as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    for one in injections[2:]:
        first = int(one["start_index"])
        rates = [row["injection_rate_mm3_per_ms"] for row in rows[first - 100 : first + 2000]]
        assert one["mass_mg"] == pytest.approx(sum(rates) * 0.01 * 0.83, rel=0.006)
