"""Tier C: realistic injectors, to whose healthy recordings `fit` fits, with measured masses or without; then worn."""

import zlib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from observer_rt.config.bench import load_bench, load_injector
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench
from tests.plants.real import Setting, real_injector
from tools.benchmarks import scoring
from tools.benchmarks.campaign import Bar, Row
from tools.benchmarks.cases import Case
from tools.benchmarks.fitting import fitted_model, maker_file, write_recordings
from tools.benchmarks.needles import How, score_by

MASSES = "masses.csv"
EVENTS = 20
FIT_EVENTS = 6  # in each recording
WEIGHED_SIGMA = 0.005  # of a mean mass
SLOW = 0.7  # of the speeds of a needle that sticks
HEALTHY, STICKS = "healthy", "needle sticks"
FLOWS: Mapping[str, Mapping[str, float]] = {
    "nozzle +12 %": {"orifice_area": 0.12},
    "coking 15 %": {"orifice_area": -0.15},
    "seat -25 %": {"seat_area": -0.25},
}
OTHERS: Mapping[str, Mapping[str, float]] = {
    STICKS: {},
    "leak": {"guide_leakage": 3e-14},
    "air": {"entrained_air": 4e-3},
    "hot fuel": {"bulk_modulus": -0.08, "fuel_density": -0.015},
    "other fuel": {"bulk_modulus": 0.06, "fuel_density": 0.02},
}
KINDS = {HEALTHY: {}, **FLOWS, **OTHERS}
MAIN = (HEALTHY, "nozzle +12 %")
_MAIN = f"weighed and kind in {MAIN}"
BARS = (
    Bar("fit_adequate_share", "adequate", "mean", least=1.0),
    Bar("valid_share", "valid_share", "mean", least=0.9, of=_MAIN),
    Bar("inside_share", "held", "mean", 0.93, 0.98, of=_MAIN),
    Bar("error_p95_pct", "observer_errors_pct", "m95", most=1.0, of=_MAIN),
    Bar("half_width_pct", "half_width_pct", "median", most=1.2, of=_MAIN),
    Bar("inside_without_masses_share", "held", "mean", 0.93, 0.98, of="not weighed", from_values=40 * EVENTS),
    Bar("error_without_masses_p95_pct", "observer_errors_pct", "m95", of="not weighed"),
    Bar("half_width_without_masses_pct", "half_width_pct", "median", of="not weighed"),
    Bar("valid_share_of_changed_flows", "valid_share", "mean", least=0.8, of=f"kind in {(*FLOWS,)}", by="kind"),
    Bar("wrong_valid", "wrong_valid", "sum", most=0, of="weighed"),
)
COLUMNS = {"fit adequate": ("adequate", "of"), **scoring.COLUMNS}


def real_model(setting: Setting, seed: int, weighed: bool, out: Path, lift: bool = True) -> Path:
    """The injector file that `fit` makes of healthy recordings. Raises RunError where it fails."""
    folder, size = out / f"{setting} {seed}{' weighed' if weighed else ''}", real_injector(setting, seed).size
    more = ["--mass", str(folder / MASSES)] if weighed else []
    return fitted_model(folder, partial(write_healthy, setting, seed, lift), more, maker_file(size.part, size.body))


def write_healthy(setting: Setting, seed: int, lift: bool, folder: Path) -> list[Path]:
    """Recordings of a healthy injector, with or without its lift, and their measured masses, in a folder."""
    injector, rng = real_injector(setting, seed), np.random.default_rng([seed, zlib.crc32(setting.encode()), 1])
    benches = {}
    for pressure, duration in injector.points:
        points, name = [(pressure, duration)] * FIT_EVENTS, f"{pressure / 1e6:.0f}MPa_{1e3 * duration:.1f}ms"
        benches[name] = injector.bench(points, injector.faults, rng)
    return write_recordings(folder, benches, folder / MASSES, WEIGHED_SIGMA, lift)


def real_case(setting: Setting, kind: str, seed: int, number: int) -> Bench:
    """Events of an injector of a kind, at pressures and durations between those it was fitted at."""
    injector = real_injector(setting, seed)
    rng = np.random.default_rng([seed, zlib.crc32(f"{setting} {kind}".encode()), number])
    pressures, durations = ((min(each), max(each)) for each in (injector.size.pressures, injector.size.durations))
    points = [(rng.uniform(*pressures), rng.uniform(*durations)) for _ in range(EVENTS)]
    faults: Faults = injector.faults._replace(**KINDS[kind])
    bench, needle = injector.bench(points, faults, rng), injector.needle
    if kind != STICKS:
        return bench
    return replace(bench, needle=replace(needle, opening_speed=SLOW * needle.opening_speed))


def score_real(setting: Setting, kind: str, seed: int, number: int, weighed: bool, model: Path, how: How) -> Row:
    """Record a case, and score the observer on it, of a bench whose sensors are as right as usual."""
    case = Case(f"{setting} {kind}", seed, number, real_case(setting, kind, seed, number))
    wrong_rate = scoring.WRONG_RATE * case.bench.injector.nozzle_area / Injector().nozzle_area
    row = score_by(how, case, load_bench(model=model), wrong_rate)
    baseline = load_injector(model).baseline
    adequate = baseline is not None and baseline.adequate
    return row | {"setting": setting, "kind": kind, "weighed": weighed, "adequate": adequate}
