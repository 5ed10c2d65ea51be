"""The learning observer's opinion of the recordings that `discover` is asked about."""

from collections import Counter
from collections.abc import Sequence

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.config.channels import with_channels_of
from observer_rt.config.signals import SignalsConfig
from observer_rt.desk.evaluation.evaluate import evaluate_stream
from observer_rt.engine.estimation.scalars import SCALARS
from observer_rt.engine.stream.state import Reason
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.identification.discovery.findings import Opinion, PrintedFigure
from observer_rt.model.effects import VOCABULARY, effective_model
from observer_rt.model.parameters import InjectorParameters

_OF_A_START = (Reason.STARTING, Reason.TOO_FEW_EVENTS, Reason.OUTSIDE_LEARNED_RANGE, Reason.JUMPED)


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
    learned = reports[-1].indicators
    indicators = {}
    for _, shown in SCALARS.shown():
        (parameter, *_), one = VOCABULARY[shown.effect].parameters, learned[shown.effect]
        sigma = None if one.sigma is None else one.sigma * shown.si(c) / parameter.si
        value = one.value * shown.si(c) / parameter.si
        indicators[shown.effect] = PrintedFigure(value=value, sigma=sigma, unit=parameter.unit)
    return Opinion(valid=valid, injections=len(reports), reasons=reasons, indicators=indicators)
