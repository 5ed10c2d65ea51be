"""The demonstration of the closed loop on a real SocketCAN interface: a drawn effect, refused, named, taken over."""

import json
import subprocess
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.daemon.journal import read_journal
from observer_rt.desk.demonstration.missing_effect import AFTER, BEFORE, HiddenEffect, hidden_effect
from observer_rt.desk.take_over import steps
from tests.daemon.end_to_end import command

LONGEST = 600.0  # s, in a machine within a machine
UNLEARNED = 1  # injections before the first that may be valid
REFUSED = 0.5  # of the injections before, at the least
RIGHT = 0.01  # of the mass


def true_masses(hidden: HiddenEffect, printed: str) -> list[float]:
    """Masses [mg] of the table, in which the truth is the third column."""
    assert hidden.words in printed
    rows = [line.split() for line in printed.splitlines() if line.strip().startswith(("as given", "amended"))]
    return [float(row[3] if row[0] == "as" else row[2]) for row in rows]


@pytest.mark.slow
@pytest.mark.vcan
@pytest.mark.parametrize(("seed", "outside"), [(1, False), (6, False), (2, True), (5, True)])
def test_a_hidden_effect_is_refused_then_named_and_the_masses_are_right(
    vcan: str, tmp_path: Path, seed: int, outside: bool
) -> None:
    out = tmp_path / "demo"
    words = [*command("demo", "--missing-effect", "--seed", str(seed), "--out", out), *(["--outside"] * outside)]
    words += ["--figure", str(tmp_path / "demo.png")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=LONGEST, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"{vcan}:" in (out / "observer.log").read_text()
    truth = true_masses(hidden_effect(seed, outside), done.stderr + done.stdout)
    assert len(truth) == BEFORE + AFTER
    rows = read_journal(out / "injections.sqlite").injections
    before, after = rows[:BEFORE], rows[BEFORE:]
    assert len({str(row["run"]) for row in rows}) == 2
    assert sum(not row["valid"] for row in before) >= REFUSED * BEFORE
    assert all(row["valid"] for row in after[UNLEARNED:])
    for row, true in zip(after[UNLEARNED:], truth[BEFORE + UNLEARNED :], strict=True):
        assert float(str(row["mass_mg"])) == pytest.approx(true, rel=RIGHT)
    findings = json.loads((out / "missing" / "findings.json").read_text())
    assert findings["verdict"] == ("unknown" if outside else "named")
    (step,) = steps(out / "bench.toml")
    assert step.before == "injector.toml"
    in_force = load_bench(out / "bench.toml").injector.parameters
    assert in_force.terms if outside else in_force.effects
    assert (tmp_path / "demo.png").read_bytes().startswith(b"\x89PNG")
