"""The learning observer on the recordings of a discovery: what its own indicators say."""

from collections import Counter
from collections.abc import Sequence

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.config.channels import with_channels_of
from observer_rt.config.signals import SignalsConfig
from observer_rt.discovery.opinion import Indicator, Opinion
from observer_rt.estimation.scalars import SCALARS
from observer_rt.evaluation.evaluate import evaluate_stream
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.observer.learning.indicators import Indicators
from observer_rt.observer.stream.state import Reason
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals

_OF_A_START = (Reason.STARTING, Reason.TOO_FEW_EVENTS, Reason.JUMPED)


def second_opinion(
    parameters: InjectorParameters, recordings: Sequence[Recording], signals: SignalsConfig | None = None
) -> Opinion | None:
    """Let the observer learn from all recordings as one history; None when it saw no injection.

    signals: of the bench file, which may state delays and lags of the channels.
    Raises `UserError` for recordings that do not fit on its bus, such as a pressure beyond its range.
    """
    bench = load_bench(EXAMPLE_BENCH).with_parameters(parameters)
    if signals is not None:
        bench = bench.with_sections(signals=with_channels_of(bench.injector.config.signals, signals))
    evaluations, _ = evaluate_stream(bench, [HeldSignals(recording) for recording in recordings])
    reports = [report for one in evaluations for report in one.reports]
    if not reports:
        return None
    reasons = Counter(
        report.reason.name for report in reports if not report.valid and report.reason not in _OF_A_START
    )
    c = effective_model(parameters).coefficients
    valid = sum(report.valid for report in reports)
    return Opinion(_indicators(reports[-1].indicators, c), valid, len(reports), reasons)


def _indicators(learned: Indicators, c: Coefficients) -> tuple[Indicator, ...]:
    """By the effects they stand for, SI."""
    return tuple(
        Indicator(
            shown.effect,
            learned[shown.effect].value * shown.si(c),
            float("nan") if (sigma := learned[shown.effect].sigma) is None else sigma * shown.si(c),
        )
        for _, shown in SCALARS.shown()
    )
