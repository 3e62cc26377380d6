"""Common layout of the pictures of laws, with the formula on the left and a contact on the right."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def draw_sheets(pictures: Mapping[str, tuple[Callable[[Any, Any], None], str, str]], out: Path) -> None:
    """Write a picture for each name, from a function that draws on both axes and the titles of these."""
    out.mkdir(parents=True, exist_ok=True)
    for name, (draw, left, right) in pictures.items():
        figure = Figure(figsize=(8.6, 3.3), layout="constrained")
        FigureCanvasAgg(figure)
        formula, contact = figure.subplots(1, 2)
        draw(formula, contact)
        for axes, title in ((formula, left), (contact, right)):
            axes.set_title(title, fontsize=10)
            axes.grid(alpha=0.3)
            if axes.get_legend() is None and axes.get_legend_handles_labels()[0]:
                axes.legend(fontsize=7.5, frameon=False)
        figure.savefig(out / f"{name}.png", dpi=110, pil_kwargs={"optimize": True})
        print(name)
