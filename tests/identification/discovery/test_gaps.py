"""The gap before and after, on operating points the sizes were not fitted to."""

import numpy as np
import pytest

from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.gaps import LINE_PRESSURE, MASS, RATE, gaps_of
from observer_rt.identification.discovery.search.verdict import SearchOptions, name_effects
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.open_loop import mass, simulated
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.conftest import WEAR, Worn
from tests.identification.discovery.hidden import NOMINAL, recordings


def test_the_amended_model_leaves_little_more_than_noise(worn: Worn) -> None:
    gaps = worn.findings.gaps.by_name
    assert gaps.keys() == {LINE_PRESSURE, RATE, MASS}
    assert all(gap.after < 0.5 * gap.before for gap in gaps.values())
    for gap in (gaps[LINE_PRESSURE], gaps[RATE]):
        assert 0.8 * gap.noise_floor < gap.after < 1.25 * gap.noise_floor


def test_mass_is_off_by_what_wear_changes(worn: Worn) -> None:
    gaps, worn_model = worn.findings.gaps, effective_model(NOMINAL, (sized("orifice_area", v_H=WEAR),))
    density = worn_model.coefficients.density
    changes = []
    for number in gaps.held_out:
        measurement = worn.task.measured[number]
        before, after = (simulated(measurement, model) for model in (effective_model(NOMINAL), worn_model))
        changes += [
            mass(measurement, new, density) - mass(measurement, old, density)
            for old, new in zip(before, after, strict=True)
        ]
    assert gaps.by_name[MASS].before * MILLIGRAM == pytest.approx(
        np.sqrt(np.mean(np.square(changes))), rel=0.15
    )


def test_what_is_shown_was_not_fitted(worn: Worn) -> None:
    gaps = worn.findings.gaps
    assert set(gaps.held_out).isdisjoint(gaps.fitted_on)
    assert sorted(gaps.held_out + gaps.fitted_on) == [0, 1, 2, 3]
    assert [point.recording for point in gaps.points] == list(gaps.held_out)


def test_one_operating_point_is_fitted_and_shown() -> None:
    measured = measurements(recordings(points=((100e6, 1.0e-3),)))
    nominal = effective_model(NOMINAL)
    gaps = gaps_of(name_effects(nominal, measured, SearchOptions(workers=2)).shown, measured, nominal)
    assert gaps.held_out == gaps.fitted_on == (0,)
    assert gaps.by_name.keys() == {LINE_PRESSURE, MASS}
    pressure = gaps.by_name[LINE_PRESSURE]
    assert pressure.before == pressure.after == pytest.approx(pressure.noise_floor, rel=0.25)
