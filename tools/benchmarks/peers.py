"""The peers on one case.

On the plant of the nominal structure: joint Kalman filters. On the richer
plant: the joint UKF on the paper's lump, as its maker says, fitted, and fitted with a measured rate. The sac of a few
mm3 follows without delay: filling it takes a thousandth of the mass.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from tests.plants.arrays import Array
from tests.plants.plant import Outcome, record
from tests.plants.wave import new_part
from tests.plants.windows import windows_of
from tools.benchmarks.campaign import Task
from tools.benchmarks.cases import CLASSES, Case, Group
from tools.benchmarks.kalman_peers import Tuning, joint_ekf, joint_ukf
from tools.benchmarks.lump_fit import fitted_lump
from tools.benchmarks.peer_equations import Model, PeerInputs, lump_model, peer_inputs
from tools.benchmarks.score import EKF, UKF, EstimatorScore, score_rate

TUNING = Tuning(wear_walk=1e-5, model_noise=3e4, line_noise=2.0)  # see kalman_peers.py

PEERS: dict[str, Callable[[PeerInputs], Array]] = {
    UKF: lambda inputs: joint_ukf(inputs, TUNING).rate,
    EKF: lambda inputs: joint_ekf(inputs, TUNING).rate,
}
"""Rate [m3/s] at every sample of a recording. The nominal model runs beside the observer."""
NOMINAL_LUMP, FITTED_LUMP, RATE_LUMP = "UKF nominal lump", "UKF fitted lump", "UKF lump, rate"


@dataclass(frozen=True)
class PeerScore(Task):
    """Peers' part of a case; tuples are per event."""

    estimators: tuple[EstimatorScore, ...]


def has_peers(class_name: str) -> bool:
    """Peers run on every class but the many cases of `stability`; a filter wants the whole recording."""
    fault_class = CLASSES[class_name]
    return fault_class.group is not Group.STABILITY and not fault_class.windowed


def score_peers(case: Case) -> PeerScore:
    """Record a case and score every peer on the recording."""
    outcome = record(case.bench)
    inputs = peer_inputs(outcome.measured)
    return peer_score(case, outcome, {name: rate_of(inputs) for name, rate_of in PEERS.items()})


def peer_score(case: Case, outcome: Outcome, rates: Mapping[str, Array]) -> PeerScore:
    """Score of the rates [m3/s] (n,) that peers tell of a recorded case."""
    windows, density = windows_of(outcome, case.bench.sample_rate), case.bench.injector.density
    scores = tuple(score_rate(name, rate, outcome.truth, windows, density) for name, rate in rates.items())
    return PeerScore(case.class_name, case.master_seed, case.number, scores)


def lumps_of(healthy: Sequence[Outcome]) -> Mapping[str, Model]:
    """The peers' models by the peers' names, fitted to these recordings."""
    return {
        NOMINAL_LUMP: lump_model(new_part(), sac_follows=True),
        FITTED_LUMP: fitted_lump(healthy, new_part(), with_rate=False),
        RATE_LUMP: fitted_lump(healthy, new_part(), with_rate=True),
    }


def wave_peers(lumps: Mapping[str, Model], case: Case) -> PeerScore:
    """Record a case and score the joint UKF on every lump."""
    outcome = record(case.bench)
    inputs = {name: peer_inputs(outcome.measured, model) for name, model in lumps.items()}
    return peer_score(case, outcome, {name: joint_ukf(each, TUNING).rate for name, each in inputs.items()})
