"""Injector files for the tests of the desk: lines of every kind, what a fit adds, and an effect in force."""

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
    text = NOMINAL_INJECTOR.read_text().replace("[line]\n", f'[line]\nmodel = "{line}"\n{ADDED[line]}{added}')
    path.write_text(f'line_outflow = "{outflow}"\n{text}{end}')
    return path


def in_force(effect: str, key: str, value: float) -> str:
    return f'\n[[effects]]\nid = "{effect}"\nparameters = {{ {key} = {{ value = {value}, unit = "-" }} }}\n'


def amended(path: Path, effect: str, key: str, value: float) -> Path:
    path.write_text(NOMINAL_INJECTOR.read_text() + in_force(effect, key, value))
    return path


def worn_file(path: Path, v_h: float = 0.3) -> Path:
    return amended(path, "orifice_area", "v_H", v_h)
