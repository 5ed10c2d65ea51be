"""Benches that state delays and lags of their channels."""

from observer_rt.config.bench import Bench, load_bench


def bench_with(**keys: dict[str, float]) -> Bench:
    """The example bench with keys of its signals, by role."""
    bench = load_bench()
    signals = bench.injector.config.signals
    changed = {role: getattr(signals, role).model_copy(update=update) for role, update in keys.items()}
    return bench.with_sections(signals=signals.model_copy(update=changed))
