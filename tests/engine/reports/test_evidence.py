"""Evidence: which events are kept and as what, their inputs as they were, and the way to another process."""

import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.engine.learning.mass import VolumeBudget
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.reports.evidence import EventEvidence, EventInputs, EvidenceKind, evidence_of, kind_of
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.stream.validity import OF_MODEL
from tests.daemon.samples import some_report


def report(*reasons: Reason, half: float = 0.001) -> InjectionReport:
    first, *further = reasons or (Reason.NONE,)
    return replace(
        some_report(),
        budget=VolumeBudget(half / 1.96 * 50e-9, 0.0, 0.0, 5e-9, 0.0),
        valid=first is Reason.NONE,
        reason=first,
        further=tuple(further),
    )


@pytest.mark.parametrize("reason", sorted(OF_MODEL))
def test_what_contradicts_the_model_is_refused(reason: Reason) -> None:
    assert kind_of([report(), report(Reason.TOO_FEW_EVENTS, reason)]) is EvidenceKind.REFUSED


@pytest.mark.parametrize(
    "reason", [Reason.SAMPLES_LOST, Reason.INPUT_FROZEN, Reason.NEEDLE_STUCK, Reason.INPUT_CLIPPED, Reason.STARTING]
)
def test_doubtful_inputs_are_evidence_of_nothing(reason: Reason) -> None:
    assert kind_of([report(), report(reason)]) is None


def test_a_mass_known_badly_is_a_doubt() -> None:
    assert kind_of([report()]) is EvidenceKind.GOOD
    assert kind_of([report(Reason.TOO_FEW_EVENTS)]) is EvidenceKind.GOOD
    assert kind_of([report(half=0.02)]) is EvidenceKind.DOUBTFUL
    assert kind_of([report(Reason.OUTSIDE_LEARNED_RANGE)]) is EvidenceKind.DOUBTFUL


def test_an_event_ends_with_its_ringing() -> None:
    """14 ms after the needle is shut, .5 ms before the end of the injection's window."""
    constants = constants_for(load_injector(), 100e3, Durations(), events_required=2)
    kept = evidence_of([report()], EventInputs(600, 0, np.zeros((3, 5000))), constants, {})
    assert kept is not None
    assert kept.signals.shape == (3, 500 - 50 + 1400)


values = st.lists(st.floats(width=64), min_size=1, max_size=40)


@given(values, values, st.sampled_from(EvidenceKind), st.text())
def test_what_is_packed_is_unpacked(rail: list[float], lift: list[float], kind: EvidenceKind, text: str) -> None:
    samples = min(len(rail), len(lift))
    first, second = np.array(rail[:samples]), np.array(lift[:samples])
    packed = EventEvidence(kind, 7, 123, 1e5, 60e6, 1e-3, {"said": text}, np.array([first, second, -first])).packed()
    stream = io.BytesIO(packed)
    line = stream.readline()
    unpacked = EventEvidence.unpacked(line, np.frombuffer(stream.read()))
    assert unpacked.packed() == packed
    assert (unpacked.kind, unpacked.event, unpacked.first_index) == (kind, 7, 123)
