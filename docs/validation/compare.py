"""The model beside others' measurements: comparisons of docs/validation.md, printed and drawn as `validation.png`.

With the whole table of the GDI injector beside it, as `gdi_masses.csv` (a heading; rail pressure in MPa, energizing
time in ms, mass in mg), the program counts and draws all of its masses; without it, those below.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.desk.injection_map.map_fit import fit_map
from observer_rt.desk.injection_map.mass_map import MassMap
from observer_rt.desk.injection_map.simulated_masses import masses_of
from observer_rt.desk.simulation.schedule import Event, Schedule, Shot
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.foundation.figures import FOUND, GIVEN, MEASURED, save_figure


def rate_of(injector, pressure, energizing):
    """Times [s] and injection rate [kg/s] of a single shot at a rail pressure [MPa], energized for a time [ms]."""
    shot = Event(1e-4, pressure * 1e6, (Shot(energizing * 1e-3),))
    truth = simulate(injector, Schedule((shot,), energizing * 1e-3 + 2.5e-3), 50e3).truth
    return truth.time, truth.injection_rate * injector.fluid.density_nozzle


time, rate = rate_of(load_injector(Path(__file__).with_name("spray_a.toml")), 150, 1.5)
plateau = np.median(rate[rate > 0.9 * rate.max()]) * 1e3  # g/s
print(f"Spray A: {plateau:.2f} g/s, {plateau / 2.57 - 1:+.1%} of what is published")


def shots(durations, masses):
    """A shot a row: 10, 20 and 30 MPa, energizing times [ms], masses [mg] in this order."""
    return np.column_stack((np.repeat((10, 20, 30), 3), np.tile(durations, 3), masses))


identified = shots((0.4, 0.9, 3.0), (3.006, 7.528, 26.680, 3.911, 10.167, 38.909, 4.234, 12.493, 50.008))
compared = shots((0.35, 1.5, 5.0), (1.735, 12.946, 47.383, 2.707, 18.361, 68.865, 3.118, 22.792, 86.907))
nominal = load_injector(NOMINAL_INJECTOR)
geometry = {
    "fluid": {"density_line": 740.0, "density_nozzle": 740.0, "bulk_modulus_line": 1.1e9, "bulk_modulus_sac": 1.1e9},
    "line": {"length": 0.3, "diameter": 3e-3, "volume": 2.1e-6, "loss_factor": 200.0},
    "seat": {"diameter": 2e-3, "max_lift": 0.07e-3},
    "nozzle": {"holes": 6, "hole_diameter": 0.165e-3, "sac_volume": 2e-9, "flow_coefficient": 0.73},
    "chamber": {"pressure": 1e6},
    "needle": {"opening_delay": 0.4e-3, "opening_speed": 1.5, "closing_delay": 0.2e-3, "closing_speed": 0.5},
}
sections = {name: getattr(nominal, name).model_copy(update=change) for name, change in geometry.items()}
start = nominal.model_copy(update={"line_outflow": "seat", **sections})


def map_of(points):
    """Map of points: rail pressure [MPa], energizing time [ms], mass [mg]; known to 2 %."""
    pressure, energizing, mass = points.T * np.array([[1e6], [1e-3], [1e-6]])
    return MassMap(pressure, energizing, mass, 0.02 * mass)


def errors(injector, points):
    """Modelled over measured masses of points, minus 1."""
    of = map_of(points)
    return masses_of(injector, of.rail_pressure, of.energizing) / of.mass - 1


done = fit_map(start, map_of(identified), lambda share: None)
for name, size in {**done.sizes, "closing less opening delay": done.delay_difference}.items():
    print(f"{name} {size.value:.4g}, {size.ci95[0]:.4g} to {size.ci95[1]:.4g} {size.unit}")
for (pressure, energizing, mass), error in zip(compared, errors(done.injector, compared), strict=True):
    print(f"{pressure:.0f} MPa, {energizing:.2f} ms: {mass:4.1f} mg measured, model {error:+.0%}")

table = Path("gdi_masses.csv")
points = np.loadtxt(table, delimiter=",", skiprows=1) if table.exists() else np.vstack((identified, compared))
others = points[~np.isin(points[:, 1], identified[:, 1])]
off = errors(done.injector, others)
for first, last in ((0.2, 0.39), (0.4, 3.0), (3.1, 5.0)):
    part = abs(off[(others[:, 1] >= first) & (others[:, 1] <= last)])
    print(f"{first} to {last} ms: {part.size}, within 4 % {(part < 0.04).sum()}, within 10 % {(part < 0.1).sum()}")
figure = Figure(figsize=(7, 3.2), layout="constrained")
axes = figure.subplots()
for pressure, colour in ((10, FOUND), (20, GIVEN), (30, MEASURED)):
    of = others[:, 0] == pressure
    axes.semilogx(others[of, 1], 100 * off[of], "o", color=colour, alpha=0.8, label=f"{pressure} MPa")
axes.axhspan(-4, 4, color="#dfe5ea")
axes.set(xlabel="energizing time [ms]", ylabel="error of the modelled mass [%]", xlim=(0.22, 6), ylim=(-40, 15))
axes.set_xticks([0.25, 0.5, 1, 2, 5], ["0.25", "0.5", "1", "2", "5"])
axes.minorticks_off()
axes.legend(frameon=False)
save_figure(figure, Path("validation.png"), 110)
