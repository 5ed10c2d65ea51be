"""Recordings without a needle lift: what each shot did, and a line with waves that is fitted to them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import observer_rt as ort
from observer_rt.config.bench import load_injector
from observer_rt.desk.library.fit import answered_again
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


@pytest.mark.slow
def test_a_line_with_waves_is_fitted_from_the_file_of_a_lump(tmp_path: Path) -> None:
    """Needle and line together; the sac is as the maker says: from 75 mm3 for 3 a search ends beside the minimum."""
    benches = healthy_benches(Variant.PLAIN, 1)
    outcomes = {name: record(bench) for name, bench in benches.items()}
    recordings = [
        commanded(benches[name], outcome, 0.28e-3, 0.34e-3, jitter=8e-6).without_lift()
        for name, outcome in outcomes.items()
    ]
    own = tmp_path / "own.toml"
    own.write_text(maker_file(new_part()))
    fitted = ort.Injector.load(own).fit(recordings[::2] + recordings[-1:])
    assert fitted.calibration is not None
    assert fitted.calibration.adequate
    assert fitted.parameters.line.model == "wave"
    needle = fitted.parameters.needle
    assert [needle.opening_delay, needle.closing_delay] == pytest.approx([0.28e-3, 0.34e-3], abs=8e-6)
    name = list(benches)[1]
    masses = fitted.evaluate(recordings[1]).injections["mass_mg"]
    assert masses.to_numpy() == pytest.approx(1e6 * true_masses(outcomes[name], benches[name]), rel=0.025)
