"""The peers on one case, and the information limit beside them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from tools.benchmarks.arrays import Array
from tools.benchmarks.cases import CLASSES, Case, Group
from tools.benchmarks.information_limit import mass_limits_mg
from tools.benchmarks.joint_fit import joint_fit_rate
from tools.benchmarks.kalman_peers import Tuning, joint_ekf, joint_ukf
from tools.benchmarks.peer_inputs import PeerInputs, peer_inputs
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.runs import Task
from tools.benchmarks.score import EKF, FIT, UKF, EstimatorScore
from tools.benchmarks.windows import score_rate, windows_of

TUNING = Tuning(wear_walk=1e-5, model_noise=3e4, line_noise=2.0)  # see peer_tuning.py

PEERS: dict[str, Callable[[PeerInputs], Array]] = {
    UKF: lambda inputs: joint_ukf(inputs, TUNING).rate,
    EKF: lambda inputs: joint_ekf(inputs, TUNING).rate,
    FIT: joint_fit_rate,
}
"""Rate [m3/s] at every sample of a recording. The nominal model runs beside the observer; the paper's scheme has a
module of its own, for it is the package's."""


@dataclass(frozen=True)
class PeerScore(Task):
    """Peers' part of a case; tuples are per event."""

    estimators: tuple[EstimatorScore, ...]
    limits_mg: tuple[float, ...]
    """The information limit, smallest standard deviation of the mass; empty where it is not computed."""


def has_peers(class_name: str) -> bool:
    """Peers run on every class but the many cases of `stability`; a filter wants the whole recording."""
    fault_class = CLASSES[class_name]
    return fault_class.group is not Group.STABILITY and not fault_class.windowed


def score_peers(case: Case) -> PeerScore:
    """Record a case and score every peer on the recording."""
    outcome = record(case.bench)
    inputs = peer_inputs(outcome.measured)
    injected = tuple(event.faults for event in case.bench.events if event.shots)
    scored = peer_score(case, outcome, {name: rate_of(inputs) for name, rate_of in PEERS.items()})
    windows = windows_of(outcome, case.bench.sample_rate)
    return replace(scored, limits_mg=mass_limits_mg(inputs, windows, injected, case.bench.injector.density))


def peer_score(case: Case, outcome: Outcome, rates: Mapping[str, Array]) -> PeerScore:
    """Score of the rates [m3/s] (n,) that peers tell of a recorded case; no limit."""
    windows, density = windows_of(outcome, case.bench.sample_rate), case.bench.injector.density
    scores = tuple(score_rate(name, rate, outcome.truth, windows, density) for name, rate in rates.items())
    return PeerScore(case.class_name, case.master_seed, case.number, scores, ())
