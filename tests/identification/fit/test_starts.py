"""From whatever file, within a factor of two, the search ends in the same minimum."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import pytest

from observer_rt.config.injector_sections import Meaning
from observer_rt.identification.fit.calibrate import calibrate
from observer_rt.identification.fit.forms import STRUCTURES, values_of, with_values
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.parameters import InjectorParameters
from tests.identification.fit.healthy import NOMINAL, WRONG
from tests.observed_plants import recording_of
from tests.plants.healthy import healthy_benches
from tests.plants.plant import record
from tests.plants.wave import LINES, Variant, real_part

PART_SEED = 1
FILES = (
    (1.0, 1.0, 1.0, 1.0),
    (0.85, 1.0, 1.0, 1.1),
    (1.25, 0.7, 0.85, 1.15),
    (0.6, 1.7, 1.2, 0.7),
    (1.01, 1.7, 0.75, 1.44),
)
"""Shares of the maker's numbers."""


@cache
def healthy(sample_rate: float, meaning: Meaning) -> tuple[Measurement, ...]:
    """Six recordings of the benchmark's richer plant."""
    benches = healthy_benches(Variant.PLAIN, PART_SEED, sample_rate, meaning is Meaning.MEAN)
    return measurements([replace(recording_of(record(bench)), meaning=meaning) for bench in benches.values()])


@pytest.mark.slow
@pytest.mark.parametrize("shares", FILES, ids=str)
def test_means_at_a_fifth_of_the_rate(shares: Sequence[float]) -> None:
    check_found(healthy(20e3, Meaning.MEAN), shares)


@pytest.mark.slow
def test_instants_from_a_file_with_wrong_stiffness_and_nozzle() -> None:
    part, fitted = real_part(PART_SEED), check_found(healthy(100e3, Meaning.INSTANT), FILES[1])
    along_pipe = part.bulk_modulus_line / (1.0 - LINES[Variant.PLAIN].end_share)  # our volume is without the end's
    assert fitted.fluid.bulk_modulus_line == pytest.approx(along_pipe, rel=0.004)
    assert fitted.nozzle.flow_coefficient * fitted.nozzle.area == pytest.approx(part.nozzle_area, rel=0.001)
    assert fitted.seat.flow_coefficient == pytest.approx(part.seat_coefficient, rel=0.0075)


def check_found(recordings: Sequence[Measurement], shares: Sequence[float]) -> InjectorParameters:
    """The fit explains the recordings, and has the hidden numbers, which are returned as found."""
    file = with_values(NOMINAL, WRONG, values_of(NOMINAL, WRONG) * shares)
    small = file.model_copy(update={"nozzle": file.nozzle.model_copy(update={"sac_volume": 3e-9})})
    by_seat = [one for one in STRUCTURES if one.line == "wave" and one.outflow == "seat"]
    done = calibrate(small, recordings, {}, lambda _: None, by_seat)
    assert done.inadequate == ()
    part, fitted = real_part(PART_SEED), done.injector
    assert fitted.fluid.bulk_modulus_line == pytest.approx(part.bulk_modulus_line, rel=0.02)
    assert fitted.nozzle.flow_coefficient * fitted.nozzle.area == pytest.approx(part.nozzle_area, rel=0.01)
    return fitted
