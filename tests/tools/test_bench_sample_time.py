"""The time of a sample is that of an observer at work."""

import numpy as np

from observer_rt.core.stream.stream import RING
from tools.benchmarks.speed.sample import (
    BLOCK,
    OPEN_LIFT,
    OPEN_PRESSURE,
    RAIL_PRESSURE,
    loaded_observer,
    run_samples,
)


def test_the_observer_timed_injects_with_all_it_can_have_learned() -> None:
    observer = loaded_observer()
    shut = np.tile([RAIL_PRESSURE, 0.0, RAIL_PRESSURE], (BLOCK, 1))
    opened = np.tile([RAIL_PRESSURE, OPEN_LIFT, OPEN_PRESSURE], (BLOCK, 1))
    run_samples(observer, shut, 0)
    run_samples(observer, opened, BLOCK)
    memory, row = observer.memory[0], observer.ring[(2 * BLOCK - 100) % RING]
    assert memory["positions"]["processed"] > 2 * BLOCK - 10
    assert memory["needle"]["is_open"]
    assert row["injection_rate"] > 30e-6
    assert abs(row["phi"][0]) > 0.0
    assert observer.ring[BLOCK - 100]["injection_rate"] == 0.0
    assert memory["in_force"]["sensor"][0] != 0.0
    assert memory["pair"]["offset"] != 0.0
    line, learned = observer.constants.coefficients.line, memory["in_force"]["line"]
    changed = dict(zip(line._fields, learned[: len(line)] != np.array(line), strict=True))
    assert all(changed[name] for name in ("a1", "a4", "leak", "air"))  # stiffness, friction, leakage, air
