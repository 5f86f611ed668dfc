"""Writes matplotlib figures to files. The same figure gives the same file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.errors import InputError, install_extra
from vm_embedded.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg")

_FORMULA = r"\mathdefault"  # in those of matplotlib

_DPI = 110  # of a .png


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of this size [inch]. Raises InputError if matplotlib is missing."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f"plots need matplotlib; {install_extra('train')}") from error
    return Figure(figsize=(width, height), layout="constrained")


def check_figure_path(path: Path) -> None:
    """Raise InputError unless the file is a .png or .svg."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"can't plot to {path}: its suffix must be {' or '.join(SUFFIXES)}")


def keep_dollar_signs(figure: Figure) -> None:
    """Let the texts of a figure be shown as they are; matplotlib takes what is between dollar signs for a formula.

    Names may have dollar signs. Only matplotlib itself, on logarithmic axes, writes formulas.
    """
    from matplotlib.text import Text

    for each in figure.findobj(Text):
        if isinstance(each, Text) and "$" in each.get_text() and _FORMULA not in each.get_text():
            each.set_parse_math(False)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure to a .png or .svg. Raises InputError for another suffix or if the file can't be written."""
    import matplotlib

    check_figure_path(path)
    keep_dollar_signs(figure)
    kind = path.suffix[1:].lower()
    # No date and no random names: the same figure gives the same file.
    with matplotlib.rc_context({"svg.hashsalt": "vm_train"}), atomic_write(path) as part:
        figure.savefig(part, dpi=_DPI, format=kind, metadata={"Date": None} if kind == "svg" else None)
