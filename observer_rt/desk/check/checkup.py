"""All findings about a bench before it runs, without touching anything."""

from pathlib import Path

from observer_rt.config.bench import Bench
from observer_rt.desk.check.bench_rules import bench_findings
from observer_rt.desk.check.findings import Finding
from observer_rt.desk.check.machine import (
    driver_findings,
    interface_findings,
    real_time_findings,
    socketcan_findings,
    this_host,
)


def checkup(bench: Bench, state: Path | None = None) -> list[Finding]:
    """Findings about files, buses, observers and machine. Checks that an error in a file prevents are left out.

    state: file with a learned state, which stays as it is, instead of the one that the bench file names. Where there
    are several injectors, each finding names its injector. Raises `UserError` for one state of several injectors.
    """
    findings = bench_findings(bench, state)
    findings += real_time_findings(this_host(bench.config.realtime, len(bench.injectors)))
    if any(link.config.interface == "socketcan" for link in bench.config.buses):
        findings += socketcan_findings()
    for link in bench.config.buses:
        is_ours = link.config.interface == "socketcan"
        findings += (
            interface_findings(link.config, location=link.location) if is_ours else driver_findings(link.config)
        )
    return findings
