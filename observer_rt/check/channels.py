"""Findings about the channels: delays and lags that the bench file states, and what is made of them."""

from observer_rt.check.findings import Finding, Level
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role, SignalConfig


def channel_findings(fitted: BenchInjector) -> list[Finding]:
    """One of each channel of which something is stated."""
    signals = {role: fitted.config.signals.of(role) for role in Role}
    return [
        Finding("channels", Level.OK, f"{role}: {said}, undone")
        for role, signal in signals.items()
        if (said := _said(signal))
    ]


def _said(signal: SignalConfig) -> str:
    delay = f"recorded {signal.filter_delay_us:g} us late" if signal.filter_delay_us else ""
    slow = f"sensor with a lag of {signal.lag_us:g} us" if signal.lag_us else ""
    return ", ".join(filter(None, (delay, slow)))
