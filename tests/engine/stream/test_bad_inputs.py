"""Inputs that are not a number, infinite or absurd: never valid while they last, forgotten soon after."""

import numpy as np
import pytest

from tests.engine.sample_stream import NOISE, RAIL, Stream, assert_levels, at_rest, lift_with, stroke

BAD = {"no number": np.nan, "infinite": np.inf, "minus infinite": -np.inf}


@pytest.mark.parametrize("signal", ["rail", "line"])
@pytest.mark.parametrize("bad", BAD.values(), ids=BAD.keys())
@pytest.mark.parametrize("opened", [False, True], ids=["shut", "open"])
def test_bad_samples_are_never_valid_and_forgotten(signal: str, bad: float, opened: bool) -> None:
    random = np.random.default_rng(6)
    length, at = 40_000, slice(5000, 5020)
    values = dict(zip(("rail", "lift", "line"), at_rest(random, length), strict=True))
    values["lift"] += lift_with(length, {20_000: 110} | ({4950: 110} if opened else {}))
    values[signal][at] = bad
    stream = Stream(events_required=0).feed(values["rail"], values["lift"], values["line"])
    rows = stream.rows
    assert not rows["valid"][at].any()
    assert stream.count("synchronisation", "numerical_resets") > 0
    assert not (rows["valid"] & ~np.isfinite(rows["injection_rate"])).any()
    assert rows["valid"][8000:].all()
    assert np.isfinite(rows["x_hat"][8000:]).all()
    peak = rows["injection_rate"][20_000:20_110].max()
    assert 50e-6 < peak < 80e-6  # m3/s: an injection after it is as if nothing had been
    assert_levels(stream.standstill.noise, NOISE, 0.05)
    assert abs(stream.standstill.offset) < 1e-4


@pytest.mark.parametrize("signal", ["rail", "line"])
@pytest.mark.parametrize("pressure", [1e9, -1e9])
def test_absurd_pressures_are_forgotten(signal: str, pressure: float) -> None:
    """The largest that the bus lets pass: the estimate stays a number and comes back to the truth."""
    length = 20_000
    values = {"rail": np.full(length, RAIL), "lift": np.zeros(length), "line": np.full(length, RAIL)}
    values["lift"][10_000:10_110] = stroke(110)
    values[signal][5000:5100] = pressure
    rows = Stream(events_required=0).feed(values["rail"], values["lift"], values["line"]).rows
    assert not (rows["valid"] & ~np.isfinite(rows["injection_rate"])).any()
    assert np.abs(rows["x_tilde"][9000:9900, 0] - 0.95).max() < 1e-3
    assert rows["valid"][9000:].all()
    assert 50e-6 < rows["injection_rate"][10_000:10_110].max() < 80e-6
