"""Peer: the paper's scheme, one pass and three free rows, trained on after every event.

The package's own `training = "paper"`, on the same recordings and through the same codec as our observer; the gain is
the one with which its target is nearest the fault.
"""

import numpy as np

from observer_rt.config.bench import Bench
from observer_rt.config.injector import LearningConfig, Training
from observer_rt.evaluation.evaluate import evaluate
from tools.benchmarks.cases import CLASSES, Case, Group
from tools.benchmarks.peers import PeerScore, peer_score
from tools.benchmarks.plant import record
from tools.benchmarks.score import PAPER
from tools.benchmarks.scoring import bench_at, recording_of

IDENTIFICATION_GAIN = 1e5  # 1/s
LEFT_OUT = ("bulk_modulus", "entrained_air")  # line faults; friction and leakage are there


def has_paper(class_name: str) -> bool:
    """On the classes that must be estimated well, but for two: the whole bench must end within the hour."""
    return CLASSES[class_name].group is Group.MAIN and class_name not in LEFT_OUT


def paper_bench(sample_rate: float) -> Bench:
    """The example bench at a sample rate [Hz], with the paper's training."""
    learning = LearningConfig(training=Training.PAPER, identification_gain=IDENTIFICATION_GAIN)
    return bench_at(sample_rate).with_sections(learning=learning)


def score_paper(case: Case) -> PeerScore:
    """Record a case and score the paper's scheme; a sample without rate counts with the nominal model's."""
    outcome = record(case.bench)
    bench = paper_bench(case.bench.sample_rate)
    trace = evaluate(bench, [recording_of(outcome)]).evaluations[0].trace
    rate = np.where(np.isnan(trace.injection_rate), trace.nominal_rate, trace.injection_rate)
    return peer_score(case, outcome, {PAPER: rate})
