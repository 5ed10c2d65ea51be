"""The lift of a needle that is not measured, as the pressures of its injections show it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.desk.evaluation.healthy_events import bench_of
from observer_rt.engine.estimation.predictor import needle_with
from observer_rt.engine.estimation.scalars import NEEDLE_LAW
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from observer_rt.identification.fit.problem import PLAIN, values_of, with_values
from observer_rt.identification.likelihood.commands import SEEN_LATE, with_lift
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.measurement import measurements as judged
from observer_rt.model.parameters import InjectorParameters


def with_answered_lift(injector: InjectorParameters, recordings: Sequence[Recording]) -> list[Recording]:
    """Recordings with the lift of every injection; one that they have is not used.

    An injector that was not fitted is taken in the plain form that knows the masses of the first recording best: on a
    line of another kind a needle makes up for waves. Raises `UserError` where no injection is explained, and as
    `evaluate`.
    """
    forms = [injector]
    if injector.baseline is None:
        formed = [(plain.of(injector), plain.free) for plain in PLAIN]
        forms += [with_values(form, free, values_of(form, free)) for form, free in formed]
    return _answered(min(forms, key=partial(_share_unknown, recordings[0])), recordings)[1]


def _share_unknown(recording: Recording, injector: InjectorParameters) -> float:
    """Mean 95 % bound of a recording's masses, as a share of them."""
    reports = evaluate(bench_of(injector, recording), [recording.without_lift()]).evaluations[0].reports
    shares = [report.mass_bound / report.mass for report in reports if report.stroke is not None]
    return float(np.mean(shares)) if shares else math.inf


def answered_again(
    injector: InjectorParameters, measurements: Sequence[Measurement]
) -> tuple[InjectorParameters, tuple[Measurement, ...]]:
    """An injector with the needle that was learned of it, and measurements with the lift by it.

    Theirs followed from another injector. Raises as `with_answered_lift`.
    """
    injector, recordings = _answered(injector, [one.recording for one in measurements])
    again = zip(judged(recordings), measurements, strict=True)
    return injector, tuple(replace(new, stated=old.stated, is_answered=True) for new, old in again)


def _answered(
    injector: InjectorParameters, recordings: Sequence[Recording]
) -> tuple[InjectorParameters, list[Recording]]:
    blind = [one.without_lift() for one in recordings]
    history = evaluate(bench_of(injector, blind[0]), blind)
    if not any(report.stroke for one in history.evaluations for report in one.reports):
        raise UserError(
            str(recordings[0].path or "recording"),
            "no injection answers its command as the injector file's needle would",
            "check `energizing`, and delays and speeds in [needle] of the injector file",
        )
    needle = needle_with(injector.needle_law, NEEDLE_LAW.of(history.knowledge.in_force))._asdict()
    del needle["stop"]
    for delay in ("opening_delay", "closing_delay"):  # the observer counts them from the first sample that shows it
        needle[delay] += SEEN_LATE / blind[0].sample_rate
    learned = injector.model_copy(update={"needle": injector.needle.model_copy(update=needle)})
    return learned, [_with_lift(one, of) for one, of in zip(recordings, history.evaluations, strict=True)]


def _with_lift(recording: Recording, evaluation: Evaluation) -> Recording:
    strokes = [(one.start_index - evaluation.first_index, one.stroke) for one in evaluation.reports]
    return with_lift(recording, [(first, stroke) for first, stroke in strokes if stroke is not None])
