"""Registry of figures: plots in the report of a run.

How to add a figure:

1. Write one module in ``simharness/outputs/run`` with a function of the run, decorated with :func:`figure`::

       @figure("Detections", "Number of detections in each frame.")
       def detections_over_time(record: Record, variant: str) -> str | None: ...

   It returns the SVG text, made with :func:`mvpose.report.svg_plots.svg_plot`, or None without data. The
   caption may contain ``{variant}``. With ``finding=``, a function of the run and of the variant, a sentence
   above the figure says what it shows.
2. Add the name of the module to :data:`MODULES`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from markupsafe import Markup

from simharness.trial.run_folder import Record

MODULES = ("standard_figures",)
"""Modules of ``simharness.outputs.run`` that register figures, in the order in which the page shows them."""

Draw = Callable[[Record, str], str | None]


@dataclass(frozen=True)
class RunFigure:
    """A registered figure."""

    title: str
    """Heading."""
    caption: str
    """What the figure shows, a sentence; ``{variant}`` stands for the name of the variant."""
    draw: Draw
    """Function of the run and of the variant to show; returns SVG, or None without data."""
    finding: Callable[[Record, str], str] | None = None
    """Function of the same that returns what the figure shows, a sentence, or an empty text."""


_registered: dict[str, RunFigure] = {}


def figure(title: str, caption: str, *, finding: Callable[[Record, str], str] | None = None) -> Callable[[Draw], Draw]:
    """Register the decorated function as a figure; the arguments are the attributes of :class:`RunFigure`.

    Raises:
        ValueError: the title is registered already.
    """
    if title in _registered:
        raise ValueError(f"the figure {title!r} is registered twice: choose another title for one of them")

    def register(draw: Draw) -> Draw:
        _registered[title] = RunFigure(title, caption, draw, finding)
        return draw

    return register


def draw_figures(record: Record, variant: str) -> list[dict[str, str]]:
    """Return ``title``, ``caption``, ``svg`` and ``finding`` of all registered figures of a run.

    They are in the order of :data:`MODULES`; those without data are left out.
    """
    modules = [import_module(f"simharness.outputs.run.{module}").__name__ for module in MODULES]
    figures = sorted(_registered.values(), key=lambda each: modules.index(each.draw.__module__))
    drawn = [(each, each.draw(record, variant)) for each in figures]
    return [
        {
            "title": each.title,
            "caption": each.caption.replace("{variant}", variant),
            "svg": Markup(svg),
            "finding": each.finding(record, variant) if each.finding else "",
        }
        for each, svg in drawn
        if svg is not None
    ]
