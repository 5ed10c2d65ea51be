"""The bars of the richer plant, and which classes and cases miss them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tools.benchmarks.bars import WEAR, above, by_class, coverage, rate_coverages, x3_ratios
from tools.benchmarks.proportions import clopper_pearson
from tools.benchmarks.score import CaseScore
from tools.benchmarks.wave_plant import Variant


@dataclass(frozen=True)
class WaveBars:
    """Limits of every case of a class on the plain line: mass error [%] and RMSE [mm3/ms]; and the valid share."""

    mass_pct: float
    rmse: float | None
    valid_share: float = 0.95


HEALTHY = WaveBars(0.3, 0.4)
FAULTY = WaveBars(0.6, 0.6)
HARD = WaveBars(1.0, None)
AVERAGED = WaveBars(1.0, 1.2)
BARS = {
    "healthy": HEALTHY,
    **dict.fromkeys(
        (
            *WEAR,
            "guide_leakage",
            "chamber_pressure_rise",
            "orifice_cavitation",
            "line_pressure_sensor_offset",
        ),
        FAULTY,
    ),
    **dict.fromkeys(("line_friction", "line_pressure_sensor_lag"), HARD),
    "wear_averaged_20_khz": AVERAGED,
}
VARIANT_PCT = 1.5  # mass of what is valid on a line the structures do not contain
X3_RATIO = 10.0
MASS_COVERAGE = (0.90, 0.98)  # of a class
RATE_COVERAGE = 0.90  # of all classes together


def wave_violations(scores: Sequence[CaseScore], variant: Variant) -> list[str]:
    """A line for every class and every case that misses a bar."""
    lines = [
        f"{s.class_name} {s.number}: {s.wrong_valid} events valid and wrong" for s in scores if s.wrong_valid
    ]
    if variant is not Variant.PLAIN:
        return [*lines, *_variant_violations(scores)]
    for name, cases in by_class(scores).items():
        if name in BARS:
            lines += _class_violations(name, cases, BARS[name])
    if (shares := rate_coverages(scores)) and np.mean(shares) < RATE_COVERAGE:
        lines.append(f"all: coverage of the 95 % interval of the rate: {np.mean(shares):.1%} < 90 %")
    return lines


def _variant_violations(scores: Sequence[CaseScore]) -> Iterator[str]:
    for s in scores:
        error = s.valid_mass_error_pct()
        if error is not None:
            place = f"{s.class_name} {s.number}"
            yield from above(place, "mass error of the valid events [%]", abs(error), VARIANT_PCT)


def _class_violations(name: str, cases: Sequence[CaseScore], bars: WaveBars) -> Iterator[str]:
    yield from above(
        name, "mass error, largest [%]", max(abs(s.mass_error_pct()) for s in cases), bars.mass_pct
    )
    if bars.rmse is not None:
        yield from above(name, "RMSE, largest [mm3/ms]", max(s.rate_rmse() for s in cases), bars.rmse)
    if (share := float(np.mean([s.valid_share for s in cases]))) < bars.valid_share:
        yield f"{name}: valid share: {share:.1%} < {bars.valid_share:.0%}"
    if (ratios := x3_ratios(cases)) and min(ratios) < X3_RATIO:
        yield f"{name}: x3-MSE ratio, smallest: {min(ratios):.3g} < {X3_RATIO:g}"
    if covered := coverage(cases):
        low, high = clopper_pearson(sum(covered), len(covered))
        if high < MASS_COVERAGE[0] or low > MASS_COVERAGE[1]:
            yield f"{name}: coverage of the 95 % interval of the mass: {np.mean(covered):.1%}, not 90-98 %"
