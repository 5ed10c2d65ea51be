"""Bench files of tests: our own layouts on one bus or several, and amplifiers of one kind on buses of their own."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from observer_rt.config.bench import Bench, load_bench

SAMPLE_RATE = 50e3  # Hz
ONE_MESSAGE = dict.fromkeys(("rail_pressure", "needle_lift", "line_pressure"), "SampleBlock")
THREE_MESSAGES = {
    "rail_pressure": "RailPressureBlock",
    "needle_lift": "NeedleLiftBlock",
    "line_pressure": "LinePressureBlock",
}
PATTERNS = {"rail_pressure": "RailPressure", "needle_lift": "NeedleLift", "line_pressure": "LinePressure"}
UNITS = {"rail_pressure": "MPa", "needle_lift": "um", "line_pressure": "MPa"}
LINKS = {"needle_lift": "lift", "line_pressure": "line"}
"""Names of the buses of signals that are not on the first."""
AMPLIFIER_SAMPLES = 28
NOTHING: Mapping[int, tuple[int, int]] = {}
_SENSORS = re.compile(r"\[signals\.(rail|line)_pressure\]\n")


def bench_text(
    messages: Mapping[str, str], extra: str = "", links: Mapping[str, str] | None = None, rate: float = SAMPLE_RATE
) -> str:
    """A bench file with messages of our database for the roles, on buses of some names; rate [Hz]."""
    signals = "".join(
        f'[signals.{role}]\nmessage = "{message}"\npattern = "{PATTERNS[role]}_{{:02d}}"\n'
        + _on_link(role, links or {})
        for role, message in messages.items()
    )
    return f'[[dbc]]\nfile = "observer_fd.dbc"\n{signals}[sampling]\nrate_hz = {rate}\n{extra}'


def sample_bench(
    folder: Path, messages: Mapping[str, str] = ONE_MESSAGE, extra: str = "", rate: float = SAMPLE_RATE
) -> Path:
    return _written(folder, bench_text(messages, extra, rate=rate))


def block_bench(folder: Path, interface: str, channels: Sequence[str]) -> Path:
    """Our own three blocks: on one channel, or each on its own, with the results on a fourth; in lockstep."""
    link = f'[link]\ninterface = "{interface}"\nchannel = "{channels[0]}"\n'
    outputs = ""
    if len(channels) > 1:
        for name, channel in zip((*LINKS.values(), "results"), channels[1:], strict=True):
            link += f'[links.{name}]\nchannel = "{channel}"\n'
        outputs = '[outputs]\nlink = "results"\n'
    extra = f"{outputs}[learning]\nlockstep = true\n"
    return _written(folder, link + bench_text(THREE_MESSAGES, extra, LINKS if outputs else None))


def own_bench(folder: Path, database: str, signals: Mapping[str, str], extra: str = "") -> Path:
    sections = "".join(f"[signals.{role}]\n{lines}\n" for role, lines in signals.items())
    path = _written(folder, f'[[dbc]]\nfile = "user.dbc"\n[[dbc]]\nfile = "observer_fd.dbc"\n{sections}{extra}')
    (folder / "user.dbc").write_text(database)
    return path


def attributes(fd: Iterable[int] = (), protected: Mapping[int, tuple[int, int]] = NOTHING) -> str:
    """The end of a database: which messages are of CAN FD, profile and data id of those that are protected."""
    kinds = ",".join(['"StandardCAN"', '"ExtendedCAN"', *(f'"{n}"' for n in range(2, 14)), '"FD"', '"ExtendedFD"'])
    lines = [
        f'BA_DEF_ BO_ "VFrameFormat" ENUM {kinds};',
        'BA_DEF_ BO_ "E2EProfile" INT 0 255;',
        'BA_DEF_ BO_ "E2EDataId" INT 0 65535;',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        'BA_DEF_DEF_ "E2EProfile" 0;',
        'BA_DEF_DEF_ "E2EDataId" 0;',
        *(f'BA_ "VFrameFormat" BO_ {number} 14;' for number in fd),
    ]
    for number, (profile, data_id) in protected.items():
        lines += [f'BA_ "E2EProfile" BO_ {number} {profile};', f'BA_ "E2EDataId" BO_ {number} {data_id};']
    return "\n".join([*lines, ""])


def twin_bench(folder: Path) -> Path:
    """Three amplifiers of one kind on three buses: same database, message, identifier and data id; in lockstep."""
    text = '[links.lift]\nchannel = "can1"\n[links.line]\nchannel = "can2"\n'
    text += '[[dbc]]\nfile = "amplifier.dbc"\n[[dbc]]\nfile = "observer_fd.dbc"\n'
    for role, unit in UNITS.items():
        text += f'[signals.{role}]\nmessage = "Samples"\npattern = "S{{}}"\nunit = "{unit}"\n{_on_link(role, LINKS)}'
    path = _written(folder, f"{text}[sampling]\nrate_hz = {SAMPLE_RATE}\n[learning]\nlockstep = true\n")
    (folder / "amplifier.dbc").write_text(_amplifier_database())
    return path


def bench_with(**keys: Mapping[str, float]) -> Bench:
    return with_signals(load_bench().exact, keys)


def with_signals(bench: Bench, keys: Mapping[str, Mapping[str, Any]]) -> Bench:
    signals = bench.injector.config.signals
    changed = {role: getattr(signals, role).model_copy(update=update) for role, update in keys.items()}
    return bench.with_sections(signals=signals.model_copy(update=changed))


def _on_link(role: str, links: Mapping[str, str]) -> str:
    return f'link = "{links[role]}"\n' if role in links else ""


def _written(folder: Path, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / "bench.toml"
    path.write_text(_SENSORS.sub(r"\g<0>accuracy_percent = 0.0\n", text))  # of simulations
    return path


def _amplifier_database() -> str:
    """One message of 28 samples, with index, counter and CRC: the same for every amplifier of this kind."""
    lines = [
        'VERSION ""',
        "BU_: Amplifier",
        "BO_ 291 Samples: 64 Amplifier",
        ' SG_ CRC : 0|16@1+ (1,0) [0|0] "" Amplifier',
        ' SG_ Counter : 16|8@1+ (1,0) [0|0] "" Amplifier',
        ' SG_ SampleIndex : 32|32@1+ (1,0) [0|0] "" Amplifier',
    ]
    lines += [f' SG_ S{k} : {64 + 16 * k}|16@1+ (0.005,-10) [0|0] "" Amplifier' for k in range(AMPLIFIER_SAMPLES)]
    return "\n".join([*lines, attributes([291], {291: (5, 7)})])
