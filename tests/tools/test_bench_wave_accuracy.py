"""Tier B of `tools/bench accuracy`: its cases, recordings, peers and bars."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.files.formats import read_recording
from observer_rt.foundation.errors import UserError
from tests.plants.laws import Laws
from tests.plants.parameters import Faults
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, record
from tests.plants.wave import LINES, Variant, new_part, real_part
from tests.plants.windows import windows_of
from tests.tools.made_scores import factors, score
from tests.tools.test_bench_accuracy import bench
from tools.benchmarks.bars import wave_violations
from tools.benchmarks.kalman_peers import joint_ukf
from tools.benchmarks.lump_fit import fitted_lump
from tools.benchmarks.peer_equations import lump_model, peer_inputs
from tools.benchmarks.peers import TUNING
from tools.benchmarks.wave_recordings import (
    NEW_PART,
    faulty_bench,
    parsed_faults,
    write_recordings,
)

DENSITY = 830.0


def recorded(events: int, faults: Faults = Faults()) -> Outcome:  # noqa: B008 - immutable
    planned = tuple(Event((60e6, 130e6, 90e6)[i % 3], (Shot(0.0, 1.2e-3),), faults) for i in range(events))
    return record(Bench(real_part(1), Needle(), planned, seed=3, line=LINES[Variant.PLAIN]))


@pytest.fixture(scope="module")
def healthy() -> Outcome:
    return recorded(3)


def test_faults_on_the_command_line() -> None:
    faults, laws = parsed_faults(["orifice_area=0.3", "guide_leakage=3e-14", "hole_closing=0.2"])
    assert (faults, laws) == (Faults(orifice_area=0.3, guide_leakage=3e-14), Laws(hole_closing=0.2))
    made = faulty_bench(Variant.PLAIN, 1, faults, laws)
    assert made.laws == laws
    assert len(made.events) == 20
    assert {e.faults for e in made.events} == {faults}
    with pytest.raises(UserError, match="orifice_area"):
        parsed_faults(["orifice=0.3"])
    with pytest.raises(UserError, match="no number"):
        parsed_faults(["orifice_area=large"])


def test_recordings_have_truth_and_the_makers_injector_beside_them(healthy: Outcome, tmp_path: Path) -> None:
    (path,) = write_recordings(tmp_path, [("one", healthy)])
    np.testing.assert_allclose(
        read_recording(path).line_pressure, healthy.measured.line_pressure, atol=1.0, rtol=0.0
    )
    truth = np.loadtxt(tmp_path / "one.csv.truth.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(truth[:, 1], healthy.truth.injection_rate / 1e-6, atol=1e-5)
    maker = load_injector(tmp_path / NEW_PART)
    part = new_part()
    assert maker.nozzle.sac_volume == part.sac_volume
    assert maker.nozzle.flow_coefficient * maker.nozzle.area == pytest.approx(part.nozzle_area)
    assert maker.line.volume == part.line_volume
    assert maker.fluid.bulk_modulus_line == part.bulk_modulus_line


def test_measured_rate_comes_with_a_wrong_inertance(healthy: Outcome, tmp_path: Path) -> None:
    (path,) = write_recordings(tmp_path, [("one", healthy)], measured_rate=True)
    measured = read_recording(path).injection_rate
    assert measured is not None
    assert np.std(measured - healthy.truth.injection_rate) == pytest.approx(0.5e-6, rel=0.02)
    assert load_injector(tmp_path / NEW_PART).line.length == pytest.approx(1.05 * new_part().line_length)


def mass_errors_pct(outcome: Outcome, rate: NDArray[np.float64]) -> NDArray[np.float64]:
    windows = windows_of(outcome, 100e3)
    masses = np.array(windows.event_masses_mg(rate, DENSITY))
    true = np.array(windows.event_masses_mg(outcome.truth.injection_rate, DENSITY))
    return np.asarray(100.0 * (masses / true - 1.0), np.float64)


def test_fitted_lump_is_better_than_the_makers_and_wrong_all_the_same(healthy: Outcome) -> None:
    lumps = (
        lump_model(new_part(), sac_follows=True),
        fitted_lump([healthy], new_part(), with_rate=False),
        fitted_lump([healthy], new_part(), with_rate=True),
    )
    errors = [
        np.abs(mass_errors_pct(healthy, joint_ukf(peer_inputs(healthy.measured, lump), TUNING).rate)).mean()
        for lump in lumps
    ]
    assert errors[0] > errors[1] > errors[2] > 3.0
    assert 1.8 < lumps[1].a1 / lumps[0].a1 < 3.0  # (pi / 2)^2: the quarter wave in the lump's mode


def test_sac_that_follows_passes_as_much_as_it_gets(healthy: Outcome) -> None:
    result = joint_ukf(peer_inputs(healthy.measured, lump_model(new_part(), sac_follows=True)), TUNING)
    first, last = healthy.openings[0]
    opened = slice(int(first) + 60, int(last) - 60)
    part, x = new_part(), result.states[opened]
    lift = healthy.measured.needle_lift[opened]
    sine, taper = 0.5, np.sin(np.radians(60.0))
    area = np.pi * lift * sine * (part.seat_diameter - 0.5 * lift * taper)
    into = part.seat_coefficient * area * np.sqrt(2.0 * 1e8 / DENSITY * (x[:, 0] - x[:, 2]))
    assert result.survived
    np.testing.assert_allclose(into, result.rate[opened], rtol=0.05)


def test_bars_name_what_misses_them() -> None:
    plain = Variant.PLAIN
    assert wave_violations([score(1.005)], plain) == []
    assert any("mass error, largest" in line for line in wave_violations([score(1.007)], plain))
    assert len(wave_violations([score(1.004, class_name="healthy")], plain)) == 1
    assert wave_violations([score(1.009, class_name="line_friction")], plain) == []
    made = score()
    rough = replace(made.estimators[0], rate_square_error=(0.4,) * 20)
    lines = wave_violations([replace(made, estimators=(rough, made.estimators[1]))], plain)
    assert any("RMSE" in line for line in lines)
    wrong = score(factors(event_5=1.04))
    assert any("valid and wrong" in line for line in wave_violations([wrong], plain))
    assert any(
        "interval of the rate" in line for line in wave_violations([score(rate_covered=(80,) * 20)], plain)
    )
    outside = score(mass_ci95_mg=((51.0, 52.0),) * 20)
    assert any("interval of the mass" in line for line in wave_violations([outside] * 20, plain))
    unsure = score(valid=(True, False) * 10)
    assert any("valid share" in line for line in wave_violations([unsure], plain))


def test_a_line_the_structures_do_not_contain_may_be_refused_but_not_wrong() -> None:
    for variant in (Variant.STEP, Variant.FRICTION):
        assert wave_violations([score(1.012)], variant) == []
        assert len(wave_violations([score(1.02)], variant)) == 1
        assert wave_violations([score(1.2, valid=(False,) * 20)], variant) == []


@pytest.mark.slow
def test_classes_are_scored_on_the_model_given(tmp_path: Path) -> None:
    arguments = "accuracy --tier B --cases 1 --classes healthy --workers 1 --no-peers --json --model"
    done = bench(*arguments.split(), str(NOMINAL_INJECTOR), "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["figures"]["valid_share_min"] == 0.0  # of a lump
    assert document["figures"]["mass_error_max_pct"] is None
    assert document["figures"]["wrong_valid"] == 0
    assert (tmp_path / "observer-plain.jsonl").exists()
