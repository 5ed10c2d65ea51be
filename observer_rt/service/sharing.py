"""What several injectors of one process cannot share."""

from pathlib import Path

from observer_rt.bus.mapping.bench_map import BenchMap, in_common
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NAME_PLACE
from observer_rt.foundation.errors import UserError
from observer_rt.service.opening import buses_of

SHARED_INTERFACES = ("socketcan", "virtual")  # whose channels can be opened several times


def refuse_shared(bench: Bench, mapped: BenchMap, state: Path | None, journal: Path | None) -> None:
    """Raise `UserError` where injectors would have one message of results, one file or one device.

    state, journal: files given on the command line.
    """
    names = [injector.name for injector in bench.injectors]
    for option, key, path in (("--state", "file", state), ("--journal", "journal", journal)):
        if path is not None and len(names) > 1:
            raise UserError(
                f"{option} {path}",
                f"is one file for {len(names)} injectors: {', '.join(names)}",
                f'leave it out, and state [state] {key} = "{path.stem}_{NAME_PLACE}{path.suffix}" in the bench file',
            )
    for what, owners in in_common(bench, mapped):
        raise UserError(
            f"{bench.path}: injectors",
            f"{' and '.join(owners)} have one {what}",
            "give each its own; `observer-rt check` names all of them",
        )
    for number, link in enumerate(bench.config.buses):
        users = [name for name, bus in zip(names, mapped.injectors, strict=True) if number in buses_of(bus)]
        if len(users) > 1 and link.config.interface not in SHARED_INTERFACES:
            raise UserError(
                f"{bench.path}: {link.place}.interface",
                f"'{link.config.interface}' can be opened once only, but {' and '.join(users)} use {link.label}",
                "use SocketCAN, or a bus for each injector",
            )
