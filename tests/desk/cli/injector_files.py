"""Injector files for the tests of commands: lines of every kind, and what a fit adds."""

from pathlib import Path

from observer_rt.config.bench import NOMINAL_INJECTOR

ADDED = {
    "lump": "",
    "wave": "damping = 2.0\nend_volume = 10e-9\n",
    "wave_two_part": "damping = 2.0\nend_volume = 10e-9\nimpedance_ratio = 0.8\n",
}
FITTED = """
[baseline]
adequate = {adequate}
level = "file"
mass_share = 0.001
sample_rate_Hz = {rate}
injections = 12
rail_pressure_MPa = [60.0, 140.0]
variance = {{}}
chi2 = {{}}
colour = {{}}
noise = {{ rail_pressure_MPa = 0.1, line_pressure_MPa = 0.15, needle_lift_um = 0.4 }}
"""


def injector(path: Path, line: str = "lump", outflow: str = "nozzle", added: str = "", end: str = "") -> Path:
    """An injector file with keys added to [line], and text at its end."""
    text = NOMINAL_INJECTOR.read_text().replace("[line]\n", f'[line]\nmodel = "{line}"\n{ADDED[line]}{added}')
    path.write_text(f'line_outflow = "{outflow}"\n{text}{end}')
    return path
