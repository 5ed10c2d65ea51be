"""Shared by the tests of discovery: a worn injector and everything `discover` says of it."""

from dataclasses import dataclass, replace
from datetime import datetime

import pytest

from observer_rt.identification.discovery.discover import DiscoveryTask, answer
from observer_rt.identification.discovery.findings import Findings, ModelSource
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import sized
from tests.identification.discovery.hidden import NOMINAL, recordings

WEAR = 0.1
WORN_POINTS = ((60e6, 0.6e-3), (60e6, 1.9e-3), (140e6, 0.6e-3), (140e6, 1.9e-3))


@dataclass(frozen=True, eq=False)
class Worn:
    task: DiscoveryTask
    findings: Findings


@pytest.fixture(scope="session")
def worn() -> Worn:
    made = recordings((sized("orifice_area", v_H=WEAR),), measured_rate=True)
    names = {f"<{number}>.csv": f"{number:064x}" for number in range(len(made))}
    task = DiscoveryTask(NOMINAL, measurements(made), (), names)
    findings = answer(task, lambda _: None)
    model = ModelSource("a & b.toml", "0" * 64, ("seat_area",))
    return Worn(task, replace(findings, model=model, made=datetime(2026, 1, 31, 12, 0), folder="found"))
