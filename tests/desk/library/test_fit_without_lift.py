"""Recordings without a needle lift: what each shot did, and a line with waves that is fitted to them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import observer_rt as ort
from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.desk.library.fit import answered_again
from observer_rt.files.signals.recording import Recording
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.identification.likelihood.reading import commands_of, with_commanded_lift
from tests.observed_plants import commanded
from tests.plants.healthy import healthy_benches
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tests.plants.wave import Variant, new_part
from tests.plants.windows import true_masses
from tools.benchmarks.fitting import maker_file

DELAYS = 0.32e-3, 0.27e-3  # s, of the nominal needle


def test_each_shot_is_found_as_late_as_it_answers() -> None:
    """Of two in an event, too, and to some us: a sample, 10 us, at first."""
    events = (Event(100e6, (Shot(0.0, 0.6e-3), Shot(1.6e-3, 1.5e-3)), Faults()),) * 6
    bench = Bench(Injector(), Needle(), events, seed=3)
    recording, nominal = commanded(bench, record(bench), *DELAYS, jitter=15e-6), load_injector()
    measurement = replace(measurements(with_commanded_lift(nominal, [recording]))[0], commands=commands_of(recording))
    again = answered_again(nominal, [measurement])[0]
    before, after = (np.std(one.recording.needle_lift - recording.needle_lift) for one in (measurement, again))
    assert after < 0.3 * before
    assert again.commands is not None
    assert np.abs(again.commands - commands_of(recording)).max() > 1.0


def recorded(bench: Bench, opens: float, shuts: float, jitter: float = 0.0) -> Recording:
    """What a bench records beside the commands that its needle answered: no lift."""
    return commanded(bench, record(bench), opens, shuts, jitter=jitter).without_lift()


@pytest.mark.slow
def test_a_line_with_waves_is_fitted_from_the_file_of_a_lump(tmp_path: Path) -> None:
    """Needle and line together; the sac is as the maker says: from 75 mm3 for 3 a search ends beside the minimum."""
    benches = list(healthy_benches(Variant.PLAIN, 1).values())
    recordings = [recorded(bench, 0.28e-3, 0.34e-3, jitter=8e-6) for bench in benches]
    (own := tmp_path / "own.toml").write_text(maker_file(new_part()))
    fitted = ort.Injector.load(own).fit(recordings[::2] + recordings[-1:])
    assert getattr(fitted.calibration, "adequate", False)
    assert fitted.parameters.line.model == "wave"
    needle = fitted.parameters.needle
    assert [needle.opening_delay, needle.closing_delay] == pytest.approx([0.28e-3, 0.34e-3], abs=8e-6)
    masses = fitted.evaluate(recordings[1]).injections["mass_mg"]
    assert masses.to_numpy() == pytest.approx(1e6 * true_masses(record(benches[1]), benches[1]), rel=0.025)


@pytest.mark.slow
def test_a_needle_four_times_as_fast_is_not_taken_for_a_large_seat(tmp_path: Path) -> None:
    """From the file's needle alone a fit ended at 2.8 and .5 m/s: long shots tell hardly more than the product."""
    (own := tmp_path / "own.toml").write_text(NOMINAL_INJECTOR.read_text().replace("speed = 0.8", "speed = 0.5"))
    events = [(Event(p, (Shot(0.0, t),), Faults()),) * 3 for p in (60e6, 140e6) for t in (0.9e-3, 1.9e-3)]
    benches = [Bench(Injector(), Needle(1.8, 1.6), of, seed=seed) for seed, of in enumerate(events)]
    fitted = ort.Injector.load(own).fit([recorded(bench, *DELAYS) for bench in benches])
    assert getattr(fitted.calibration, "adequate", False)
    sizes = fitted.parameters.seat.flow_coefficient, fitted.parameters.needle.opening_speed
    assert sizes == pytest.approx([0.75, 1.8], rel=0.2)
