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


def bench_at(sample_rate: float, model: Path | None = None, accuracy_percent: float = 0.0) -> Bench:
    """The example bench at a sample rate [Hz], with another injector file, and pressure sensors, than its own."""
    bench = load_bench(model=model)
    signals = bench.injector.config.signals
    sensors = {
        name: getattr(signals, name).model_copy(update={"accuracy_percent": accuracy_percent})
        for name in ("rail_pressure", "line_pressure")
    }
    return bench.with_sections(
        sampling=SamplingConfig(rate_hz=sample_rate), signals=signals.model_copy(update=sensors)
    )
