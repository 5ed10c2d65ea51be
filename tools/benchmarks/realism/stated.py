"""What a bench file says of a channel's delay and lag, `[signals.<role>]`, and whether this observer knows it."""

from collections.abc import Collection
from typing import Any

from observer_rt.config.bench import Bench
from observer_rt.config.signals import LaggedSignalConfig, SignalConfig
from tools.benchmarks.realism.disturbance import LIFT, LINE, Stated


def is_known(stated: Stated) -> bool:
    """Whether a bench file may say this."""
    return all(key in _known(role) for role, keys in stated.items() for key in keys)


def _known(role: str) -> Collection[str]:
    section = LaggedSignalConfig if role in (LIFT, LINE) else SignalConfig
    return section.model_fields


def with_stated(bench: Bench, stated: Stated) -> Bench:
    """The bench file's bench with these keys of its signals."""
    signals = bench.injector.config.signals
    update: dict[str, Any] = {
        role: getattr(signals, role).model_copy(update=keys) for role, keys in stated.items()
    }
    return bench.with_sections(signals=signals.model_copy(update=update))
