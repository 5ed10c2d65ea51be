"""Nothing is valid that was not tested: faults in recordings, whatever the observer learns."""

import pytest

from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.units import MILLISECOND
from tests.daemon.surgery import FAULTS, SAMPLE_RATE, Finding, Learning, Onset, Surgery, operate

UNDETECTED = 0.4 * MILLISECOND  # for which wrong samples may be valid, until the innovations show the fault


def found(wear: float, fault: str | None, learning: Learning, onset: Onset = Onset.SHUT) -> Finding:
    return operate(Surgery(wear, fault, onset, learning))


@pytest.mark.slow
@pytest.mark.parametrize("learning", Learning)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_between_injections(fault: str, learning: Learning) -> None:
    wear = 0.0 if learning in (Learning.OFF, Learning.LATE) else 0.3  # so that something was valid before
    finding = found(wear, fault, learning)
    assert finding.valid >= 2
    assert finding.wrong_injections == 0
    assert finding.longest_run < UNDETECTED * SAMPLE_RATE


@pytest.mark.parametrize("learning", Learning)
@pytest.mark.parametrize(
    "fault", ["line pressure in bar", "line pressure dead", "lift frozen", "rail pressure dead"]
)
def test_a_fault_while_the_needle_is_open(fault: str, learning: Learning) -> None:
    finding = found(0.0, fault, learning, Onset.OPEN)
    assert finding.wrong_injections == 0
    assert finding.longest_run < UNDETECTED * SAMPLE_RATE


@pytest.mark.parametrize("learning", Learning)
@pytest.mark.parametrize("fault", ["line pressure in bar", "line pressure 5 MPa high", "pressures swapped"])
def test_a_fault_from_the_start_makes_nothing_valid(fault: str, learning: Learning) -> None:
    assert found(0.0, fault, learning, Onset.START).valid == 0


@pytest.mark.parametrize("learning", [Learning.OFF, Learning.LATE])
def test_wear_that_is_not_learned_is_not_valid(learning: Learning) -> None:
    finding = found(0.3, None, learning)
    assert finding.valid == 0
    assert finding.reason is Reason.MODEL_INADEQUATE


@pytest.mark.parametrize("learning", Learning)
def test_a_healthy_injector_is_valid_however_little_is_learned(learning: Learning) -> None:
    finding = found(0.0, None, learning)
    assert finding.valid >= finding.injections - 2
    assert finding.reason is Reason.NONE
