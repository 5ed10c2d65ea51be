"""Evidence as a measurement: what the bench file states of the line pressure's channel is known of it, too."""

from pathlib import Path

import pytest
from rich.console import Console

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.config.injector import EvidenceConfig
from observer_rt.identification.likelihood.kept_events import evidence_against, read_folder
from tests.kept_evidence import keep


def test_a_stated_lag_of_the_line_pressure_is_known_of_its_evidence(tmp_path: Path) -> None:
    bench = load_bench(EXAMPLE_BENCH).with_sections(evidence=EvidenceConfig(folder=str(tmp_path / "kept")))
    signals = bench.injector.config.signals
    lagging = signals.line_pressure.model_copy(update={"lag_us": 5.0})
    bench = bench.with_sections(signals=signals.model_copy(update={"line_pressure": lagging}))
    keep(bench, injections=10)
    console = Console(quiet=True)
    kept = evidence_against(read_folder(tmp_path / "kept", console), tmp_path / "kept", None, console)
    (stated,) = kept.measurement.stated
    assert stated.effect.id == "line_pressure_sensor_lag"
    assert stated.values == pytest.approx((5e-6,))
