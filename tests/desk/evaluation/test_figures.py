"""The picture of evaluated recordings: every line can be seen, and nothing lies on anything else."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.desk.evaluation.curves import MassRow, RateCurves, numbers_shown
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.figures import LEAST_SHOWN, Picture, draw_masses, injections_figure, pictures_of
from observer_rt.desk.simulation.schedule import energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLIGRAM, MILLISECOND, MM3_PER_MS

TIME = np.linspace(0.0, 2.0, 50) * MILLISECOND
RATE = 60.0 * MM3_PER_MS * np.sin(np.linspace(0.0, np.pi, 50))


def picture(title: str, sigma: float | None = None, reference: float | None = None) -> Picture:
    """Injections of 50 and 100 mg by the nominal model, 1 % more as estimated; sigma: of their rate [mm3/ms]."""
    sigmas = None if sigma is None else np.full(TIME.size, sigma * MM3_PER_MS)
    curves = {1: RateCurves("injection 1", TIME, 1.01 * RATE, RATE, None, sigmas)}
    rows = [
        MassRow(number, 1.01 * mass, mass, reference and reference * mass, True, (1.005 * mass, 1.015 * mass))
        for number, mass in ((1, 50.0 * MILLIGRAM), (2, 100.0 * MILLIGRAM))
    ]
    return Picture(title, curves, rows)


def test_a_percent_of_a_mass_can_be_seen_whatever_the_masses_are() -> None:
    axes = Figure().add_subplot()
    draw_masses(axes, [picture("one")], "measured")
    low, high = axes.get_ylim()
    assert high - low < 3.0
    bars = [bar for bar in axes.patches if isinstance(bar, Rectangle)]
    estimated = [bar.get_height() for bar in bars if bar.get_height()]
    assert estimated == pytest.approx([1.0, 1.0])
    assert {text.get_text() for text in axes.texts} == {"50.50", "101.00"}
    assert "numbers: mg" in axes.get_title(loc="right")


def test_rounding_is_no_difference_of_masses() -> None:
    mass = 50.0 * MILLIGRAM
    axes = Figure().add_subplot()
    draw_masses(axes, [Picture("one", {}, [MassRow(1, mass * (1.0 + 1e-15), mass, None, True)])], "measured")
    assert axes.get_ylim() == pytest.approx((-LEAST_SHOWN, LEAST_SHOWN), rel=0.2)


def test_errors_are_those_of_the_reference_where_there_is_one() -> None:
    axes = Figure().add_subplot()
    draw_masses(axes, [picture("one", reference=1.02)], "measured")
    assert {text.get_text() for text in axes.texts} == {"-0.98"}
    assert "mass error against measured" in axes.get_ylabel()


@pytest.mark.parametrize("changed", [0.0, 0.97])
def test_what_the_events_were_is_drawn_where_one_was_not_as_before(changed: float) -> None:
    ordinary = picture("one")
    posterior = (("changed", changed), ("as before", 1.0 - changed))
    rows = [ordinary.masses[0], replace(ordinary.masses[1], posterior=posterior)]
    figure = injections_figure([replace(ordinary, masses=rows)], "measured")
    drawn = [axes for axes in figure.axes if axes.get_ylabel().startswith("probability")]
    assert len(drawn) == (changed > 0.0)
    for axes in drawn:
        bars = [bar for bar in axes.patches if isinstance(bar, Rectangle)]
        heights = {round(bar.get_x() + 0.5 * bar.get_width()): bar.get_height() for bar in bars[-2:]}
        assert heights == pytest.approx({1: 0.0, 2: changed})


@pytest.mark.parametrize("recordings", [1, 2])
def test_laws_learned_are_drawn_of_a_single_recording(recordings: int) -> None:
    drop = np.linspace(10.0, 100.0, 5)
    change, half, seen = np.full(5, -0.1), np.full(5, 0.01), np.ones(5, bool)
    curve = LearnedLaw("orifice_area", ("pressure_drop_MPa",), (drop,), change, half, seen, 0.97)
    shown = replace(picture("one"), learned=(curve,))
    axes = injections_figure([shown] * recordings, "measured").axes
    drawn = [panel for panel in axes if panel.get_xlabel() == "pressure drop [MPa], nozzle"]
    assert len(drawn) == (recordings == 1)
    for panel in drawn:
        assert panel.lines[-1].get_ydata() == pytest.approx(-10.0)


def test_an_interval_that_tells_nothing_does_not_flatten_the_curves() -> None:
    figure = injections_figure([picture("one", sigma=50.0)], "measured")
    low, high = figure.axes[0].get_ylim()
    assert -10.0 < low < 0.0
    assert 60.0 < high < 70.0


@pytest.mark.parametrize("is_known", [True, False])
def test_the_corrected_rate_is_thicker_than_the_live_one(is_known: bool) -> None:
    drawn = picture("one")
    corrected = np.where(is_known, 1.02 * RATE, np.nan)
    shown = replace(drawn, curves={1: replace(drawn.curves[1], corrected=corrected)})
    lines = {line.get_label(): line for line in injections_figure([shown], "measured").axes[0].lines}
    assert ("by its own pressures" in lines) is is_known
    assert ("observer, live" in lines) is is_known
    if is_known:
        thick, thin = lines["by its own pressures"], lines["observer, live"]
        assert thick.get_linewidth() > 1.5 * thin.get_linewidth()
        assert thick.get_ydata() == pytest.approx(1.02 * RATE / MM3_PER_MS)


def test_a_learned_lift_is_drawn_where_the_needle_was() -> None:
    """It opens and closes 80 us later than the file says; its own lift is not recorded."""
    schedule, bench = make_schedule([100e6], 1, 0.06, [1.2e-3]), load_bench()
    made = simulate(load_injector(), schedule, 100e3, noise=SimulatedNoise())
    recording = made.recording.with_arrays({"energizing": np.roll(energized(schedule, made.recording.time), -8)})
    (evaluation,) = evaluate(bench, [recording.without_lift()], curves_of=bench.injector.coefficients).evaluations
    drawn_axes = injections_figure(pictures_of([evaluation]), "measured").axes
    (axes,) = (each for each in drawn_axes if each.get_ylabel().startswith("needle lift"))
    time, lift = np.asarray(axes.lines[0].get_data(), float)
    drawn = evaluation.injections[0].start + time[lift > 150.0][[0, -1]] * MILLISECOND
    assert drawn == pytest.approx(made.truth.time[made.truth.needle_lift > 150e-6][[0, -1]], abs=25e-6)
    *learned, landing = axes.texts[0].get_text().splitlines()
    assert learned[0].startswith("needle opens later by = +")
    assert [landing.split(" ")[0], *(" ± " in line for line in learned)] == ["lands", *[True] * 4]  # no bounce


@pytest.mark.parametrize("count", [2, 6, 8])
def test_the_legend_of_several_recordings_lies_on_nothing(count: int) -> None:
    names = [f"measured_on_the_other_bench/recording_number_{number}.csv" for number in range(count)]
    drawn = injections_figure([picture(name) for name in names], "measured")
    drawn.draw_without_rendering()
    (legend,) = drawn.legends
    box = legend.get_window_extent()
    assert 0.0 <= box.x0 < box.x1 <= drawn.bbox.x1
    others = [axes.get_tightbbox() for axes in drawn.axes]
    assert not any(box.overlaps(other) for other in others if other is not None)
    assert drawn.get_suptitle() == ""
    assert f"{count} recordings" in legend.get_title().get_text()


def test_without_a_choice_first_middle_and_last() -> None:
    assert (numbers_shown((), range(1, 13)), numbers_shown((), {3})) == ([1, 7, 12], [3])
    assert (numbers_shown((), ()), numbers_shown((2, 5), range(1, 13))) == ([], [2, 5])


@pytest.mark.parametrize(("present", "choices"), [((), "no injection was found"), ((1, 2), "there are 1 to 2")])
def test_one_that_is_not_there_is_named(present: tuple[int, ...], choices: str) -> None:
    with pytest.raises(UserError, match=f"no injection 3(?s:.*){choices}"):
        numbers_shown((3,), present)
