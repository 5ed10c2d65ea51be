"""The figures of a run beside the bars they are judged by."""

from collections.abc import Iterator

from tools.benchmarks.figure import Figure
from tools.benchmarks.speed.evaluated import ARRAYS, CAN_LOG, MDF4, PARQUET
from tools.benchmarks.speed.injectors import NUMBERS
from tools.benchmarks.speed.measure import Speed
from tools.benchmarks.speed.roundtrip import BUSY, ECHO, LEAN, OURS, PEER
from tools.benchmarks.speed.scaling import exponent
from tools.benchmarks.speed.traffic import SAMPLES

EVALUATE_BARS = {ARRAYS: 0.8, PARQUET: 0.5, MDF4: 0.5, CAN_LOG: 0.5}
"""Of the core's speed, by what is evaluated."""


def figures(speed: Speed) -> list[Figure]:
    """All of them, None for those not measured."""
    parts = (_round_trip, _sustained, _sample, _evaluate, _training, _rest)
    return [figure for part in parts for figure in part(speed)]


def _round_trip(speed: Speed) -> Iterator[Figure]:
    found = speed.roundtrips
    echo = "C echo, worst pace"
    yield Figure("roundtrip_p50_vs_c_echo", found.ratio(OURS, ECHO) if found else None, echo, 2.0)
    yield Figure("roundtrip_busy_p50_vs_c_echo", found.ratio(BUSY, ECHO) if found else None, echo, 2.0)
    yield Figure(
        "roundtrip_busy_p50_vs_quiet", found.ratio(BUSY, OURS) if found else None, "ours, Python quiet", 1.1
    )
    excess = "C echo's own, in p50 of ours"
    yield Figure("roundtrip_p999_excess", found.excess(OURS) if found else None, excess, 2.0)
    yield Figure("roundtrip_busy_p999_excess", found.excess(BUSY) if found else None, excess, 2.0)
    peer = "python-can, cantools, numpy; paces it keeps"
    yield Figure(
        "roundtrip_speedup_vs_python_can", found.speedup(PEER) if found else None, peer, at_least=5.0
    )
    lean = "the same without an observer"
    yield Figure("roundtrip_speedup_vs_python_can_lean", found.speedup(LEAN) if found else None, lean)


def _sustained(speed: Speed) -> Iterator[Figure]:
    found = speed.sustained
    yield Figure("sustained_khz", found.sustained_khz if found else None, "100 kHz sent", at_least=99.9)
    yield Figure("cpu_share", found.cpu_share if found else None, "one core", 0.5)
    yield Figure("lost_samples", float(found.lost_samples) if found else None, "all sent", 0.0)
    yield Figure("sustained_p999_us", found.latency.p999 if found else None, "")


def _sample(speed: Speed) -> Iterator[Figure]:
    found = speed.sample
    yield Figure("sample_vs_c", found.ratio if found else None, "C -O3, same tanh", 1.3)
    yield Figure(
        "whole_step_vs_c", found.whole / found.in_c if found else None, "the same C: no events, no statistics"
    )


def _evaluate(speed: Speed) -> Iterator[Figure]:
    found = speed.evaluate
    for source, bar in EVALUATE_BARS.items():
        name = f"evaluate_{source.replace(' ', '_')}_vs_core"
        value = found.share(source) if found else None
        yield Figure(name, value, "the compiled core alone, nothing learned", at_least=bar)


def _training(speed: Speed) -> Iterator[Figure]:
    found = speed.training
    yield Figure(
        "training_speedup_vs_scipy", found.ratio if found else None, "scipy BFGS, same gradient", at_least=3.0
    )
    yield Figure("training_exponent", found.exponent if found else None, "1: linear in samples", 1.1)


def _rest(speed: Speed) -> Iterator[Figure]:
    started = speed.startup
    yield Figure("ready_warm_s", started.warm_s if started else None, "", 3.0)
    yield Figure("ready_cold_s", started.cold_s if started else None, "", 20.0)
    yield Figure("memory_mib", started.memory_mib if started else None, "")
    yield Figure("samples_exponent", exponent(speed.scaling) if speed.scaling else None, "1: linear", 1.1)
    most = speed.injectors[-1] if speed.injectors else None
    what = f"{NUMBERS[-1]} injectors, windows, learning"
    yield Figure("injectors_cpu_share", most.cpu_share if most else None, f"one core; {what}", 1.0)
    yield Figure("injectors_lost_samples", float(most.lost_samples) if most else None, what, 0.0)
    yield Figure("injectors_not_judged", float(most.injections - most.judged) if most else None, what, 0.0)
    yield Figure("block_samples", SAMPLES, "")
    yield Figure("substeps", float(speed.sample.substeps) if speed.sample else None, "")
