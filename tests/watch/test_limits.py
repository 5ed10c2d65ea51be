"""Ends of an axis: around all that is to be seen, not too far, and the same as long as possible."""

from hypothesis import assume, given
from hypothesis import strategies as st

from observer_rt.watch.page.panel import round_limits

_VALUES = st.floats(-1e4, 1e4)


@given(_VALUES, _VALUES, st.floats(0.1, 100.0), st.tuples(_VALUES, _VALUES))
def test_all_is_seen_and_fills_the_axis(
    one: float, other: float, span: float, before: tuple[float, float]
) -> None:
    assume(before[0] < before[1])
    low, high = min(one, other), max(one, other)
    first, last = round_limits(low, high, span, before)
    slack = 1e-9 * max(abs(low), abs(high), 1.0)
    assert first <= low + slack
    assert last >= high - slack
    assert last - first >= span * (1.0 - 1e-9)
    assert last - first <= 3.0 * max(high - low, span) * (1.0 + 1e-9)
    assert round_limits(low, high, span, (first, last)) == (first, last)


def test_noise_moves_no_axis() -> None:
    limits = round_limits(-0.3, 78.2, 10.0, (0.0, 10.0))
    assert limits == (-5.0, 80.0)
    assert round_limits(-0.1, 79.4, 10.0, limits) == limits
