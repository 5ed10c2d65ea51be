"""Figures as notebooks show them."""

from observer_rt.foundation.figures import NotebookFigure


def test_a_notebook_is_given_a_picture() -> None:
    assert NotebookFigure()._repr_png_().startswith(b"\x89PNG")
