"""`tools/bench accuracy` as its users see it, and our observer scored on a short case."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tools.benchmarks.cases import Case, make_case
from tools.benchmarks.score import NOMINAL, OBSERVER, CaseScore
from tools.benchmarks.scoring import score_case

REPOSITORY = Path(__file__).parents[2]
LIMIT_S = 300.0


def bench(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tools.benchmarks", *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        check=False,
        timeout=LIMIT_S,
    )


def shortened(name: str, events: int = 5) -> Case:
    case = make_case(name, 1, 0)
    return replace(case, bench=replace(case.bench, events=case.bench.events[:events]))


@pytest.fixture(scope="module")
def worn() -> CaseScore:
    return score_case(shortened("orifice_area"))


def test_nominal_model_is_right_on_a_healthy_plant_that_shares_no_code_with_it() -> None:
    score = score_case(shortened("healthy"))
    assert max(abs(score.event_errors_pct(NOMINAL))) < 0.4
    assert max(score.estimator(NOMINAL).rate_square_error) < 0.3**2


def test_observer_is_scored_event_by_event(worn: CaseScore) -> None:
    nominal, observer = (abs(worn.event_errors_pct(name)) for name in (NOMINAL, OBSERVER))
    assert nominal.min() > 10.0
    assert observer[2:].max() < 2.0
    assert worn.estimator(OBSERVER).x3_square_error[4] < 0.1 * worn.estimator(NOMINAL).x3_square_error[4]
    assert worn.valid == (False, False, True, True, True)
    assert worn.reasons[0] != ""
    assert len(worn.training_ms) == 5
    assert min(worn.training_ms) > 0.0


@pytest.mark.slow
def test_a_run_resumes_and_prints_the_figures(tmp_path: Path) -> None:
    arguments = ("accuracy", "--cases", "1", "--classes", "healthy", "--workers", "1", "--no-peers", "--json")
    first = bench(*arguments, "--out", str(tmp_path))
    assert first.returncode == 0, first.stderr
    figures = json.loads(first.stdout)["figures"]
    assert figures["mass_error_max_pct"] < 1.0
    stored = (tmp_path / "observer.jsonl").read_text()
    assert len(stored.splitlines()) == 1
    again = bench(*arguments, "--out", str(tmp_path))
    resumed = json.loads(again.stdout)["figures"]
    measured_anew = {name for name in figures if name.startswith("sample_")}
    assert measured_anew == {"sample_open_us", "sample_closed_us"}
    assert all(resumed[name] == value for name, value in figures.items() if name not in measured_anew)
    assert (tmp_path / "observer.jsonl").read_text() == stored


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("accuracy", "--classes", "healthy,nozzel"), ("nozzel", "orifice_area")),
        (("accuracy", "--tier", "B", "--model", "fitted.toml", "--no-peers"), ("fitted.toml",)),
        (("realism", "--only", "hum_line"), ("hum_line", "hum_50_hz_line")),
        (("speed", "--only", "sample,nonsense"), ("'nonsense'", "roundtrip")),
        (("wave-recordings", "--fault", "nozzle=1"), ("orifice_area",)),
        (("wave-recordings", "--rate", "30"), ("divisor",)),
    ],
)
def test_what_is_wrong_on_the_command_line_is_the_users_to_mend(
    arguments: tuple[str, ...], named: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "fitted.toml").write_text("[line\n")
    out = tmp_path / "out"
    goes_to = () if arguments[0] == "speed" else ("--out", str(out))
    done = bench(*arguments, *goes_to, folder=tmp_path)
    assert done.returncode == 2
    assert all(word in done.stderr for word in named)
    assert "Traceback" not in done.stderr
    assert not out.exists()
