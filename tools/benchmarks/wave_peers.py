"""Peers on the richer plant: the joint UKF on a lump, as its maker says, fitted, and fitted with measured rate."""

from collections.abc import Mapping, Sequence

from tools.benchmarks.cases import Case
from tools.benchmarks.fitted_lump import fitted_lump
from tools.benchmarks.kalman_peers import joint_ukf
from tools.benchmarks.peer_equations import Model
from tools.benchmarks.peer_inputs import lump_model, peer_inputs
from tools.benchmarks.peers import TUNING, PeerScore
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.wave_plant import new_part
from tools.benchmarks.windows import score_rate, windows_of

NOMINAL_LUMP, FITTED_LUMP, RATE_LUMP = "UKF nominal lump", "UKF fitted lump", "UKF lump, rate"
PEER_CASES = 4  # of a class: a joint UKF takes some 15 s a recording

Lumps = Mapping[str, Model]


def lumps_of(healthy: Sequence[Outcome]) -> Lumps:
    """The peers' models by the peers' names, fitted to these recordings."""
    return {
        NOMINAL_LUMP: lump_model(new_part(), sac_follows=True),
        FITTED_LUMP: fitted_lump(healthy, new_part(), with_rate=False),
        RATE_LUMP: fitted_lump(healthy, new_part(), with_rate=True),
    }


def score_wave_peers(case: Case, lumps: Lumps) -> PeerScore:
    """Record a case and score the joint UKF on every lump."""
    outcome = record(case.bench)
    windows = windows_of(outcome, case.bench.sample_rate)
    density = case.bench.injector.density
    scores = []
    for name, model in lumps.items():
        result = joint_ukf(peer_inputs(outcome.measured, model), TUNING)
        scores.append(score_rate(name, result.rate, outcome.truth, windows, density))
    return PeerScore(case.class_name, case.master_seed, case.number, tuple(scores), ())
