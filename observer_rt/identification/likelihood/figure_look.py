"""How the figures of `fit` and `discover` look: colours and matplotlib settings."""

MEASURED, GIVEN, FOUND = "#1b1f24", "#c0392b", "#1f77b4"
"""Of what was measured, of the model as given, and of the one that was found."""
LOOK = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#59636e",
    "axes.labelcolor": "#1b1f24",
    "xtick.color": "#59636e",
    "ytick.color": "#59636e",
    "axes.grid": True,
    "grid.color": "#e3e7eb",
    "axes.axisbelow": True,
}
