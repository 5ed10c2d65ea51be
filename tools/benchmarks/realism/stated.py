"""What a bench file says of a channel's delay and lag, `[signals.<role>]`, and whether this observer knows it."""

from typing import Any

from observer_rt.config.bench import Bench
from observer_rt.config.signals import SignalConfig
from tools.benchmarks.realism.disturbance import Stated


def is_known(stated: Stated) -> bool:
    """Whether a bench file may say this."""
    return all(key in SignalConfig.model_fields for keys in stated.values() for key in keys)


def with_stated(bench: Bench, stated: Stated) -> Bench:
    """The bench file's bench with these keys of its signals."""
    signals = bench.injector.config.signals
    update: dict[str, Any] = {
        role: getattr(signals, role).model_copy(update=keys) for role, keys in stated.items()
    }
    return bench.with_sections(signals=signals.model_copy(update=update))
