"""Knowledge and injections as they might have been learned and reported, for tests of what keeps them."""

from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from observer_rt.engine.estimation.belief import Belief
from observer_rt.engine.estimation.parameters import PARAMETERS, SCALARS, Parameter
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.predictor import NoiseLevels
from observer_rt.engine.learning.coil_current import CoilCurrent, CoilDisturbance, CoilPulse, EdgeSearch
from observer_rt.engine.learning.kinds import Mode, Velocity
from observer_rt.engine.learning.knowledge import Account, Knowledge, LearnedInjector, LearningState, Overdispersion
from observer_rt.engine.learning.mass import EventPoint, VolumeBudget
from observer_rt.engine.learning.noise import ORDERS, Colour, RestingNoise, Whitening
from observer_rt.engine.reports.indicators import Estimate
from observer_rt.engine.reports.injection_report import CommandedOpening, InjectionReport
from observer_rt.engine.stream.standstill import HeldRail, RestingLift, RestPoint, SensorSlope
from observer_rt.engine.stream.state import Reason, State
from observer_rt.model.surroundings import Surroundings

PRESSURE_SCALE = 1e8  # Pa


def some_knowledge(seed: int = 1, phi_version: int = 7, events: int = 20) -> Knowledge:
    random = np.random.default_rng(seed)
    root = 0.1 * random.normal(size=(PARAMETERS, PARAMETERS))
    covariance = root @ root.T + 1e-6 * np.eye(PARAMETERS)
    covariance = 0.5 * (covariance + covariance.T)
    lowest, highest = SCALARS.bounds(PRESSURE_SCALE)
    belief = Belief(random.uniform(-0.01, 0.01, PARAMETERS), covariance, 0.6 * covariance)
    belief.mean[Parameter.CONTROL_END] = -5.5  # a valve that shuts 0.55 ms early; late it may be by 0.4 ms
    in_force = np.clip(random.uniform(-0.01, 0.01, PARAMETERS), lowest, highest)
    noise = NoiseLevels(*(random.uniform(0.1, 1.0, 3) * [1e6, 1e6, 1e-6]).tolist())
    learned = LearnedInjector(
        belief=belief,
        theta=0.9 * in_force,
        statistics=PhaseStatistics(
            *(random.uniform(0.0, 1e4, sums.shape) for sums in vars(no_statistics()).values())
        ),
        active=frozenset(column for column in SCALARS.gate.columns if random.random() < 0.5),
        is_prior=False,
        at_rest=RestingNoise(count=2.0),
        learned_at=tuple(EventPoint(*point) for point in random.uniform(-1.0, 1.0, (3, 3)).tolist()),
        colour=Colour(
            Whitening(
                forgetting=0.96 if random.random() < 0.5 else None, taps=random.normal(size=random.integers(ORDERS))
            ),
            interval=1e-5,
            sigma=float(random.uniform(5e-4, 2e-3)),
        ),
    )
    velocity = Velocity(np.ones(2), np.ones((PARAMETERS, 2)), np.eye(2))
    state = LearningState(
        account=Account(learned, {Mode.QUICK: 0.9, Mode.PASSING: 0.1}, velocity),
        noise=noise,
        events=events,
        interval=1e-5,
        changes=1.5,
        sensor_slope=SensorSlope((RestPoint(6e7, -1e5, 1e8), RestPoint(1e8, 2e5, 2e8)), 0.01),
        overdispersion=Overdispersion(12.0, 11.0),
        held_rail=HeldRail(0.95, 1),
        energizing=CoilDisturbance(
            EdgeSearch(np.ones(4), np.ones(4), np.ones((2, 4))),
            CoilCurrent(np.ones(3), np.ones(3), CoilPulse(0.002, 30, 20), np.eye(PARAMETERS)),
        ),
    )
    lift = RestingLift(*(random.uniform(-1.0, 1.0, 3) * [4e-5, 0.0, 4e-13] + [0.0, 2e-7, 0.0]).tolist())
    return Knowledge(state, in_force, phi_version, lift)


def damage(path: Path, data: st.DataObject) -> bytes:
    """Cut the file off anywhere, or put other bytes for one of it; what it holds then."""
    content = bytearray(path.read_bytes())
    position = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans(), label="truncate"):
        del content[position:]
    else:
        content[position : position + 1] = data.draw(st.binary(max_size=20))
    path.write_bytes(content)
    return bytes(content)


def some_report(number: int = 1, **changes: Any) -> InjectionReport:
    """The injection of a number, in SI units, with everything known that can be known unless changed."""
    content: dict[str, Any] = {
        "number": number,
        "event": number,
        "start_position": 1000 * number,
        "end_position": 1000 * number + 100,
        "start_index": 5000 + 1000 * number,
        "end_index": 5000 + 1000 * number + 100,
        "volume": 50e-9,
        "mass": 41.5e-6 + number * 1e-9,
        "live_mass": 41.6e-6 + number * 1e-9,
        "predicted_mass": 41.4e-6 + number * 1e-9,
        "rate_sigma": np.full(101, 1e-7),
        "corrected_rate": np.full(101, 5e-5),
        "peak_rate": 69e-6,
        "rail_pressure": 120e6,
        "valid": True,
        "reason": Reason.NONE,
        "state": State.ADAPTED,
        "phi_version": number,
        "indicators": {shown.effect: Estimate(0.3, 0.01) for _, shown in SCALARS.shown()},
        "density": 830.0,
        "surroundings": Surroundings(313.15, 5e6),
        "commanded": CommandedOpening(number, 320e-6, 1.1e-3),
        "budget": VolumeBudget(*(share * 0.5e-6 / 830.0 / 1.96 for share in (0.6, 0.8, 0.0, 0.0, 0.0))),
    }
    return InjectionReport(**(content | changes))
