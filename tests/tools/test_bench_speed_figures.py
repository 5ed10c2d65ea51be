"""`tools/bench speed` and `soak`: what is made of what was measured."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from tools.benchmarks.report import Figure, finite
from tools.benchmarks.speed.kept import CHANGES, WITH, WITHOUT, KeptRow, Turn
from tools.benchmarks.speed.pace import latency_of
from tools.benchmarks.speed.roundtrip import ECHO, OURS, PEER, RoundTrip, RoundTrips
from tools.benchmarks.speed.sustained import Soak, Stretch
from tools.benchmarks.speed.traffic import Ids, write_bench


def made_round_trips() -> RoundTrips:
    def made(p50: float, lost: int = 0) -> RoundTrip:
        seconds = p50 * 1e-6 * np.ones(10)
        return RoundTrip(latency_of(seconds), latency_of(seconds), lost)

    return RoundTrips(
        "vcan0",
        {
            "90 us": {ECHO: made(40), OURS: made(120), PEER: made(90_000, lost=28)},
            "1.5 ms": {ECHO: made(40), OURS: made(60), PEER: made(480)},
        },
        {},
        {},
    )


def test_ratios_take_the_worst_pace_and_no_peer_that_loses() -> None:
    found = made_round_trips()
    assert found.ratio(OURS, ECHO) == pytest.approx(3.0)
    assert found.speedup(PEER) == pytest.approx(8.0)
    assert found.excess(OURS) == pytest.approx(80 / 120)


def test_no_verdict_at_a_pace_the_echo_does_not_keep() -> None:
    found = made_round_trips()
    fast = {
        **found.found["90 us"],
        ECHO: RoundTrip(latency_of(np.full(10, 1.0)), latency_of(np.full(10, 1.0)), 0),
    }
    busy = replace(found, found={**found.found, "90 us": fast})
    assert busy.ratio(OURS, ECHO) == pytest.approx(1.5)  # of the other pace
    assert busy.excess(OURS) == pytest.approx(20 / 60)
    none = replace(found, found={"90 us": fast})
    assert none.ratio(OURS, ECHO) is none.excess(OURS) is none.speedup(PEER) is None


def test_bars() -> None:
    assert Figure("x", 2.0, "", at_most=2.0).is_met is True
    assert Figure("x", 2.1, "", at_most=2.0).is_met is False
    assert Figure("x", 4.9, "", at_least=5.0).is_met is False
    assert Figure("x", None, "", at_least=5.0).is_met is None
    assert Figure("x", 1.0, "").is_met is None


def test_what_is_no_number_is_null() -> None:
    document = finite({"a": float("nan"), "b": [1.0, float("inf")], "c": (2, "x")})
    assert json.loads(json.dumps(document, allow_nan=False)) == {"a": None, "b": [1.0, None], "c": [2, "x"]}


def test_growth_is_that_of_the_settled_part() -> None:
    def stretch(number: int, memory: float) -> Stretch:
        return Stretch(number / 6, 9, 9, 0, 0, latency_of(np.ones(1)), 0.5, memory, 11, 5)

    grown = Soak(tuple(stretch(n, 300.0 + max(0.0, 20.0 - n) + 0.01 * n) for n in range(100)), "")
    assert grown.growth_mib_an_hour == pytest.approx(0.01 * 360)
    assert np.isnan(Soak(grown.stretches[:5], "").growth_mib_an_hour)


def test_a_disturbed_turn_is_one_of_many() -> None:
    turns = tuple(
        Turn(share, 3, latency_of(np.full(9, 1e-6 * us))) for share, us in ((0.2, 60), (0.9, 9e3), (0.1, 50))
    )
    row = KeptRow(turns, "")
    assert (row.cpu_share, row.lost_samples) == (0.2, 9)
    assert (row.p50, row.p999) == pytest.approx((60.0, 60.0))


def test_one_of_the_two_keeps_every_event(tmp_path: Path) -> None:
    kept = {
        name: load_bench(write_bench(tmp_path / str(n), "virtual", "x", Ids(), *changes)).injector
        for n, (name, changes) in enumerate(CHANGES.items())
    }
    assert kept[WITHOUT].evidence is None
    assert kept[WITH].evidence == tmp_path / "1" / "evidence"
    assert kept[WITH].config.evidence.per_point == 1000
