"""Benches without a lift sensor: needles that answer their commands unlike the injector file's."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from observer_rt.config.bench import Bench as Observer
from observer_rt.core.model.needle import NeedleLaw, lift_of_stroke
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import Shot, stroke
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effective import LAG_UNIT
from observer_rt.model.parameters import InjectorParameters
from tests.observed_plants import commanded
from tests.plants.plant import LIFT_NOISE, Bench, Needle, Outcome, record, strokes_of
from tools.benchmarks import campaign, scoring
from tools.benchmarks.campaign import Bar, Row
from tools.benchmarks.cases import Case
from tools.benchmarks.faults.bench import bouncing, smooth
from tools.benchmarks.scoring import FROM, OBSERVER, WRONG_RATE, Injection, score_evaluation, score_outcome

OPENS_LATER, CLOSES_LATER = (-80e-6, 80e-6), (-150e-6, 150e-6)  # s, than the file's needle
FASTER = (0.95, 1.05)  # than the plant's, which is up to 15 % faster or slower than the file's
JITTER, LARGE_JITTER = 10e-6, 30e-6  # s, one sigma of a shot's
SHORTEST, LONGEST_FALL = 0.1e-3, 1.5e-3  # s, of a command; from its end until the file's needle is shut
COUNT_FROM = 3  # event, from 0: the first stands apart
KEPT = "kept"  # as a peer
SIDES: Mapping[str, str] = {"opening": "needle_opens_later", "closing": "needle_closes_later"}
EVEN = ("healthy", "orifice_area", "nozzle")  # in the names of classes in which delays are judged
_LAW, _SHAPES, _EVEN = "not is_shape", "is_shape", "even and not is_shape"
_EACH = "class_name"


class Kind(StrEnum):
    """The needles that cases have in turn."""

    USUAL = "usual"
    BOUNCES = "bounces"
    JITTERS = "jitters"
    SLOPES = "two slopes"


SHAPES = {Kind.BOUNCES: (bouncing, 25.0), Kind.SLOPES: (smooth, 20.0)}  # um; % of the way, slow at either end
BARS = (
    Bar("first_valid_share", "first_valid", "mean", least=0.9),
    *(Bar(f"first_mass_{how}_pct", "first_errors_pct", how, most=most)
      for how, most in (("m50", 0.4), ("m95", 1.2), ("m100", 3.0))),
    Bar("first_inside_share", "first_held", "mean", 0.93, 0.98),
    *(Bar(f"mass_{how}_pct", f"{OBSERVER}_errors_pct", how, most=most, of=_LAW, by=_EACH)
      for how, most in (("m50", 0.2), ("m95", 0.6), ("m100", 1.5))),
    Bar("mass_of_shapes_m95_pct", f"{OBSERVER}_errors_pct", "m95", most=1.0, of=_SHAPES),
    Bar("valid_share", "valid_share", "mean", by=_EACH),
    Bar("rate_rmse_p95_mm3_per_ms", f"{OBSERVER}_rmse", "p95", most=0.4, of=_LAW),
    Bar("rate_rmse_of_shapes_p95", f"{OBSERVER}_rmse", "p95", most=1.0, of=_SHAPES),
    Bar("live_mass_m95_pct", "live_errors_pct", "m95", most=2.0, of="needle == 'usual'"),
    Bar("live_rate_rmse_p95", "live_rmse", "p95", most=1.5, of="needle == 'usual'"),
    Bar("inside_share", "held", "mean", 0.92, 0.98),
    Bar("rate_coverage", "rate_coverage", "mean", 0.92, 0.98),
    Bar("wrong_valid", "wrong_valid", "sum", most=0),
    *(Bar(f"{which}{side}_delay_p95_us", f"{which}{side}_us", "p95", most=most, of=_EVEN)
      for which, most in (("first_", 25.0), ("", 8.0)) for side in SIDES),
    Bar("mass_of_kept_needle_m50_pct", f"{KEPT}_errors_pct", "m50"),
)  # fmt: skip
COLUMNS: dict[str, tuple[str, campaign.How]] = {
    **scoring.COLUMNS,
    "first: valid": ("first_valid", "of"),
    "first: mass %": ("first_errors_pct", "spread"),
    "first: inside": ("first_held", "of"),
    "rate covered": ("rate_coverage", "mean"),
    "live mass %": ("live_errors_pct", "spread"),
    "live RMSE": ("live_rmse", "spread"),
    **{f"{which}{side} us": (f"{which}{side}_us", "spread") for which in ("first_", "") for side in SIDES},
    "needle kept, mass %": (f"{KEPT}_errors_pct", "spread"),
}


class How(NamedTuple):
    with_peer: bool = False
    has_lift: bool = True

    def __str__(self) -> str:
        return f"{' by commands' * (not self.has_lift)}{' with peer' * self.with_peer}"


class BenchRun(NamedTuple):
    """A bench, what came of it, seen by commands, and how much later than the file's its needle opens, closes [s]."""

    bench: Bench
    outcome: Outcome
    recording: Recording
    later: tuple[float, float]


def recorded(bench: Bench, law: NeedleLaw, kind: Kind = Kind.USUAL) -> BenchRun:
    """Record a bench with a needle unlike the file's, but no command too short for an injector."""
    rng = np.random.default_rng([bench.seed, 1])
    up, down = rng.uniform(*FASTER, 2) * (bench.needle.opening_speed, bench.needle.closing_speed)
    bench = replace(bench, needle=Needle(up, down))
    strokes = [strokes_of(event, 0.0, bench.needle, bench.injector.max_lift) for event in bench.events]
    spare = min(closing - opening for opening, _, closing, *_ in np.concatenate(strokes)) - SHORTEST
    opens = rng.uniform(*OPENS_LATER)
    latest = min(CLOSES_LATER[1], opens + spare + law.opening_delay - law.closing_delay)
    closes = rng.uniform(CLOSES_LATER[0], latest)
    if kind in SHAPES:
        change, size = SHAPES[kind]
        bench = change(bench, size, rng)
    outcome, jitter = record(bench), LARGE_JITTER if kind is Kind.JITTERS else JITTER
    seen = commanded(bench, outcome, law.opening_delay + opens, law.closing_delay + closes, jitter)
    return BenchRun(bench, outcome, seen.without_lift(), (opens, closes))


def score_by(how: How, case: Case, observer: Observer, wrong_rate: float = WRONG_RATE) -> Row:
    """Record a case, and score the observer on it; without a lift with another needle, the first injection apart.

    Learned delays are judged against the drawn ones [us]; the only peer keeps the needle of the file. wrong_rate: as
    in `Score.facts`.
    """
    if how.has_lift:
        return score_outcome(case, record(case.bench), observer).facts(wrong_rate)
    kind, injector = [*Kind][case.number % len(Kind)], observer.injector.parameters
    bench, outcome, recording, later = recorded(case.bench, injector.needle_law, kind)
    case = replace(case, bench=bench)
    evaluation = evaluate(observer, [recording]).evaluations[0]
    score = replace(score_evaluation(case, outcome, observer, evaluation), count_from=COUNT_FROM)
    if how.with_peer:
        kept = evaluate(observer, [with_kept_needle(recording, injector)]).evaluations[0]
        score.estimates[KEPT] = score_evaluation(case, outcome, observer, kept).estimates[OBSERVER]
    first = [each for each in score.injections if each.event == 0]

    def off(injections: list[Injection], number: int) -> list[float]:
        sizes = [each.report.indicators.get([*SIDES.values()][number]) for each in injections if each.report]
        return [abs(size.value * LAG_UNIT - later[number]) / MICROSECOND for size in sizes if size]

    row: Row = {
        "needle": kind,
        "is_shape": kind in SHAPES,
        "even": any(word in case.class_name for word in EVEN),
        "first_valid": score.valid[0],
        "first_errors_pct": score.errors_pct([each for each in first if each.valid]).tolist(),
        "first_held": score.covered(0) if score.valid[0] else None,
    }
    for number, side in enumerate(SIDES):
        row[f"first_{side}_us"] = off(first, number)
        row[f"{side}_us"] = off([each for each in score.injections if each.event >= FROM], number)
    return score.facts(wrong_rate) | row


def with_kept_needle(recording: Recording, injector: InjectorParameters) -> Recording:
    """A recording with the lift of a needle as the injector file has it, as if that were measured."""
    assert recording.energizing is not None
    lift = np.random.default_rng(recording.samples).normal(0.0, LIFT_NOISE, recording.samples)
    for on, off in (np.flatnonzero(np.diff(recording.energizing)) + 1).reshape(-1, 2):
        start, end = recording.time[[on, off]].tolist()
        moved = stroke(Shot(end - start), start, float(recording.rail_pressure[on]), injector)
        if moved is not None:
            span = slice(on, off + round(LONGEST_FALL * recording.sample_rate))
            lift[span] += [lift_of_stroke(time, moved) for time in recording.time[span].tolist()]
    return replace(recording, needle_lift=lift)
