"""What a fit says of what it leaves: where, and the cause, if a refit shows one."""

import re
from collections.abc import Mapping
from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.identification.fit.calibrate import calibrate
from observer_rt.identification.fit.document import oddities, verdict_words
from observer_rt.identification.fit.forms import LOSS, NOZZLE, SAC, SEAT, STIFFNESS, with_values
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.fit.healthy import LUMPS, NOMINAL, of_independent_plant, off_by_ten_percent, simulations
from tests.plants.parameters import Faults, Injector


def test_what_disagrees_is_said_and_no_cause_that_a_refit_did_not_show() -> None:
    """A lift later than any sensor's shows in the phases after it: where, how much, its sign."""
    recordings = [each.recording for each in simulations(((60e6, 0.6e-3), (100e6, 1.9e-3)))]
    late = [replace(each, needle_lift=np.roll(each.needle_lift, 20)) for each in recordings]
    done = calibrate(NOMINAL, measurements(late), {}, lambda _: None, LUMPS[:1])
    words = verdict_words(done)
    assert re.search("and not enough|No single effect", words)
    figures = r"Most is left in (\w+) at (\d+) MPa: ([\d.]+) MPa one sample ahead \(noise alone ([\d.]+)\)"
    match = re.search(figures, words)
    assert match is not None
    assert match[1] in {phase.label for phase in done.inadequate}
    assert match[2] in ("60", "100")
    assert float(match[3]) > 3.0 * float(match[4])
    assert re.search("measured more often (above|below) the model", words)
    assert not any(cause in words for cause in ("smoothed", "belong together", "IMPLAUSIBLE", "check "))
    with_rate = verdict_words(replace(done, rate_misfit=0.05))
    assert "Not tried: whether the measured rate or the model has the wrong shape, which is 5.0% off" in with_rate
    assert "contradicts" not in with_rate


@pytest.mark.decisive(1)
@pytest.mark.parametrize(
    ("fault", "cause", "is_adequate"),
    [
        ({"chamber_pressure_step": 15e6}, "chamber_pressure_rise dp = 15.1 MPa", False),
        ({"entrained_air": 2e-3}, "entrained_air g = 0.00198", True),
        ({"lift_offset": 10e-6}, "lift_offset x_0 = 10", False),
    ],
)
def test_the_cause_is_shown_by_a_refit(fault: Mapping[str, float], cause: str, is_adequate: bool) -> None:
    """On an independent plant. What moves no mass is adequate, but for a sensor's: the recordings are off then."""
    recordings = of_independent_plant(Injector(drained_by_seat=1), faults=Faults(**fault))
    done = calibrate(off_by_ten_percent(), measurements(recordings), {}, lambda _: None, LUMPS[1:])
    words = verdict_words(done)
    assert f"A refit shows the cause: {cause}" in words
    assert (not done.inadequate) is ("is part of every interval" in words) is is_adequate


def test_an_entry_far_from_the_truth_is_named() -> None:
    """A line three times too long is fitted as well as the right one; masses are a third."""
    line = NOMINAL.line.model_copy(update={"length": 3.0 * NOMINAL.line.length})
    free = (STIFFNESS, LOSS, SEAT, NOZZLE, SAC)
    scaled = np.array([3.0, 9.0, 1 / 3, 1 / 3, 1 / 3]) * [one.of(NOMINAL) for one in free]
    file = with_values(NOMINAL.model_copy(update={"line": line}), free, scaled)
    done = calibrate(file, measurements([one.recording for one in simulations()]), {}, lambda _: None, LUMPS[:1])
    assert verdict_words(done).startswith("adequate")
    assert "IMPLAUSIBLE: fluid.bulk_modulus_line" in verdict_words(done)
    assert any("check line.volume (K_L counts only as K_L/V_L), line.length" in line for line in oddities(done))
    assert not any("is at the end of the range tried" in line for line in oddities(done))
    calibration = copy(done.fitted.calibration)
    calibration.free = tuple(replace(one, highest=1.005 * one.of(done.injector)) for one in calibration.free)
    near = oddities(replace(done, fitted=replace(done.fitted, calibration=calibration)))
    assert sum("is at the end of the range tried" in line for line in near) == len(free)
