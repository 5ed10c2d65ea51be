"""The plants as the observer meets them: what is recorded of one, and a bench of that sample rate."""

from pathlib import Path

from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector import SamplingConfig
from observer_rt.files.signals.recording import Recording
from tests.plants.plant import Outcome


def recording_of(outcome: Outcome) -> Recording:
    """What the observer is given: no truth."""
    m = outcome.measured
    return Recording(m.time, m.rail_pressure, m.needle_lift, m.line_pressure)


def bench_at(sample_rate: float, model: Path | None = None) -> Bench:
    """The example bench at a sample rate [Hz], with another injector file than its own."""
    return load_bench(model=model).with_sections(sampling=SamplingConfig(rate_hz=sample_rate))
