"""`--fuel-temperature`: of recordings, which know none."""

from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command, document
from tests.device import candump_lines, frames_of

HOT = 90.0  # degC


@pytest.fixture(scope="module")
def hot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("hot") / "hot.csv"


@pytest.fixture
def recording(command: Command, hot: Path) -> Path:
    """Injections of a new injector with hot fuel."""
    if not hot.exists():
        command.done(
            "simulate",
            "--fuel-temperature",
            HOT,
            "--energizing-time",
            "1.2",
            "--injections",
            4,
            "--output",
            hot,
        )
    return hot


def test_hot_fuel_is_known_when_it_is_told(command: Command, recording: Path) -> None:
    told, untold = (
        document(command, recording, *option)["recordings"][0]["injections"][-1]
        for option in (("--fuel-temperature", HOT), ())
    )
    assert told["valid"]
    assert abs(told["indicators"]["bulk_modulus"]["value"]) < 0.01
    assert abs(told["mass_mg"] / told["nominal_mass_mg"] - 1.0) < 0.005
    assert not untold["valid"] or untold["indicators"]["bulk_modulus"]["value"] < -0.1


def test_a_log_tells_its_own(command: Command, recording: Path, bench: Path, tmp_path: Path) -> None:
    signal = '[signals.fuel_temperature]\nmessage = "SampleBlock"\nsignal = "FuelTemperature"\n'
    bench.write_text(bench.read_text() + signal)
    log = tmp_path / "bus.log"
    log.write_text("".join(candump_lines(frames_of(bench, recording))))
    assert "a log has it in signals.fuel_temperature" in command.refused(
        "evaluate", log, "--bench", bench, "--fuel-temperature", 60
    )
