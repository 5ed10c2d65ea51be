"""An injection that lasts longer than samples are remembered: where it began stays known, its curves do not."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.config.injector import SamplingConfig
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.model.effects import effective_model
from tests.benches import SAMPLE_RATE
from tests.device import simulated

BENCH = load_bench().with_sections(sampling=SamplingConfig(rate_hz=SAMPLE_RATE))
BEGIN, END = 0.3503, 1.12  # s, from an opening on


def test_a_needle_that_sticks_for_long() -> None:
    recording = simulated(24)
    assert (END - BEGIN) * SAMPLE_RATE > RING
    held = (recording.time > BEGIN) & (recording.time < END)
    noise = 0.4e-6 * np.random.default_rng(1).normal(size=recording.samples)
    stuck = replace(recording, needle_lift=np.where(held, 290e-6 + noise, recording.needle_lift))
    c = effective_model(BENCH.injector.parameters).coefficients
    (evaluation,) = evaluate(BENCH, [HeldSignals(stuck)], curves_of=c, traces=()).evaluations
    injections = list(evaluation.injections)
    assert [each.start for each in injections] == sorted(each.start for each in injections)
    (long,) = [each for each in injections if each.end - each.start > 0.5]
    assert long.start == pytest.approx(BEGIN, abs=1e-3)
    assert long.end == pytest.approx(END, abs=1e-3)
    assert np.isnan(long.nominal_mass)
    assert all(each.nominal_mass > 0.0 for each in injections if each is not long)
    assert len(evaluation.curves) == len(injections)
