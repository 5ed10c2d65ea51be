"""What `check` says of delays and lags."""

from observer_rt.check.findings import Level
from observer_rt.check.mapping import channel_findings
from observer_rt.check.observer import observer_findings
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from tests.benches import bench_with


def test_nothing_is_said_where_nothing_is_stated() -> None:
    assert channel_findings(load_bench().injector) == []


def test_what_is_stated_is_said_channel_by_channel() -> None:
    bench = bench_with(
        line_pressure={"filter_delay_us": 22.5}, needle_lift={"filter_delay_us": 4, "lag_us": 15.9}
    )
    found = channel_findings(bench.injector)
    assert {each.level for each in found} == {Level.OK}
    assert [each.text.split(":")[0] for each in found] == [Role.NEEDLE_LIFT, Role.LINE_PRESSURE]
    assert "4 us late" in found[0].text
    assert "lag of 15.9 us" in found[0].text
    assert "22.5 us late" in found[1].text
    assert "lag" not in found[1].text


def test_the_dead_band_is_that_of_the_louder_lift() -> None:
    """0.4 um times sqrt(1 + (15.9 us / 10 us)^2 / 2), five times; and one sample more must be known."""
    plain, slow = (
        {one.topic: one.text for one in observer_findings(bench.injector)}
        for bench in (load_bench(), bench_with(needle_lift={"lag_us": 15.9}))
    )
    assert "opens above 2 um" in plain["dead band"]
    assert "opens above 3.01 um" in slow["dead band"]
    before, after = (int(texts["look-ahead"].split()[0]) for texts in (plain, slow))
    assert after == before + 1
