"""Evidence as a measurement: what the bench file states of the line pressure's channel is known of it, too."""

from pathlib import Path

import pytest
from rich.console import Console

from observer_rt.config.bench import load_bench
from observer_rt.config.injector_sections import EvidenceConfig
from observer_rt.engine.reports.evidence import EvidenceKind
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_hash
from observer_rt.identification.likelihood.kept_events import FEWEST_EVENTS, evidence_of_model, read_folder
from tests.kept_evidence import keep


def test_events_dropped_meanwhile_are_counted_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Before they are read, and once they are read but not asked yet."""
    folder, console = tmp_path / "kept", Console()
    keep(load_bench().exact.with_sections(evidence=EvidenceConfig(folder=str(folder))), injections=10)
    first, *_ = folder.glob("*.parquet")
    for digit in "123":  # a name that is listed, behind which there is nothing
        (folder / f"refused_100MPa_900us_ab_{digit}.parquet").symlink_to(tmp_path / "dropped")
    events = read_folder(folder, console)
    assert f"{folder}: 3 events were dropped" in capsys.readouterr().out.replace("\n", " ")
    assert file_hash(first) in {one.sha256 for one in events}
    before = evidence_of_model(events, folder, None, console)
    for path in folder.glob("*.parquet"):
        path.unlink()
    assert evidence_of_model(events, folder, None, console).hashes == before.hashes
    alike = max(([one for one in events if one.kind is kind] for kind in EvidenceKind), key=len)
    assert len(evidence_of_model(alike[:FEWEST_EVENTS], folder, None, console).measurement.events) == FEWEST_EVENTS
    with pytest.raises(UserError, match=f"fewer than {FEWEST_EVENTS} events of a kind"):
        evidence_of_model(alike[: FEWEST_EVENTS - 1], folder, None, console)


def test_a_stated_lag_of_the_line_pressure_is_known_of_its_evidence(tmp_path: Path) -> None:
    bench = load_bench().exact.with_sections(evidence=EvidenceConfig(folder=str(tmp_path / "kept")))
    signals = bench.injector.config.signals
    lagging = signals.line_pressure.model_copy(update={"lag_us": 5.0})
    bench = bench.with_sections(signals=signals.model_copy(update={"line_pressure": lagging}))
    keep(bench, injections=10)
    console = Console(quiet=True)
    kept = evidence_of_model(read_folder(tmp_path / "kept", console), tmp_path / "kept", None, console)
    (stated,) = kept.measurement.stated
    assert stated.effect.id == "line_pressure_sensor_lag"
    assert stated.values == pytest.approx((5e-6,))
