"""Common style of the figures, with colours that colour-blind readers can distinguish."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import matplotlib as mpl
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..text import brief

# Okabe–Ito palette: distinguishable with every common colour vision and in grey.
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, YELLOW, BLACK = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#F0E442", "#222222",
)  # fmt: skip
CYCLE = (BLUE, RED, GREEN, ORANGE, PURPLE, SKY, BLACK)
GREY = "#8A8A8A"
ENERGIES = {"kinetic": BLUE, "rotational": PURPLE, "pistons": GREEN, "potential": SKY, "dissipated": RED}
"""Colors of energies, in figures and pages."""
SPEED_MAP = "viridis"

_RC = {
    "figure.dpi": 100,
    "savefig.dpi": 220,
    "figure.constrained_layout.use": True,
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.prop_cycle": cycler(color=CYCLE),
    "lines.linewidth": 1.6,
    "lines.markersize": 4,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "legend.facecolor": "white",
    "legend.fontsize": 8.8,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.labelsize": 9,
    "xtick.major.pad": 5.5,
    "ytick.major.pad": 4.5,
    "ytick.labelsize": 9,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "haff",
}


_TITLED: ContextVar[bool] = ContextVar("titled", default=True)


@contextmanager
def style(*, title: bool = True) -> Iterator[None]:
    """Matplotlib settings of all figures, and whether they get titles, for the time of a ``with`` block."""
    before = _TITLED.set(title)
    try:
        with mpl.rc_context(_RC):
            yield
    finally:
        _TITLED.reset(before)


def headline(figure: Figure, title: str, subtitle: str) -> None:
    """Title and a smaller line of facts, left-aligned above all panels; nothing where figures have no titles."""
    if not _TITLED.get():
        return
    # Not a suptitle: the layout engine would reserve space for that alone, and notebooks would cut the second line off.
    height = figure.get_figheight()
    figure.text(0.02, 1 - 0.08 / height, title, ha="left", va="top", fontsize=12, fontweight="bold")
    line = figure.text(0.02, 1 - 0.31 / height, subtitle, ha="left", va="top", fontsize=9, color="#555555")
    wide = line.get_window_extent().width / (0.96 * figure.bbox.width)
    if wide > 1:
        line.set_fontsize(9 / wide)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0, 0, 1, 1 - 0.56 / height))  # type: ignore[call-arg]


def label(text: str, most: int = 100) -> str:
    """Text of a file for use in matplotlib: one line, of limited length, with formulas disabled."""
    plain = brief(text, most).replace("$", r"\$")
    # Legends omit labels that begin with an underscore.
    return "\u2009" + plain if plain.startswith("_") else plain


def note(axes: Axes, text: str, *, x: float = 0.02, y: float = 0.04, ha: str = "left", va: str = "bottom") -> None:
    """A short text inside the axes, in a corner without data."""
    axes.text(
        x, y, text, transform=axes.transAxes, ha=ha, va=va, fontsize=8.8, color="#333333", linespacing=1.45,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 2},
    )  # fmt: skip


def left_out(axes: Axes, what: str, why: str, *, x: float = 0.02, y: float = 0.04, ha: str = "left") -> None:
    """A note that a curve is not drawn, and the reason, in a corner: a lower one by default."""
    lines = textwrap.wrap(f"{what}: {why}", 62, break_long_words=True)
    note(axes, "\n".join(map(label, lines)), x=x, y=y, ha=ha, va="top" if y > 0.5 else "bottom")


def zoom(axes: Axes, low: float, high: float, *, least: float = 0.0, around: float | None = None) -> None:
    """Limits for [low, high] with margins of 8 %, at least ``least`` high and centred on ``around`` if given."""
    if around is not None:
        reach = max(abs(high - around), abs(low - around), least / 2)
        low, high = around - reach, around + reach
    elif high - low < least:
        middle = (low + high) / 2
        low, high = middle - least / 2, middle + least / 2
    air = 0.08 * (high - low)
    axes.set_ylim(low - air, high + air)


def number(value: float, digits: int = 4) -> str:
    """A number for a caption: few digits, powers of ten written as such."""
    text = f"{value:.{digits}g}"
    if "e" not in text:
        return text
    mantissa, exponent = text.split("e")
    return f"{mantissa}·10$^{{{int(exponent)}}}$"


def page(width: float, height: float, *, beside: float, below: float) -> tuple[float, float]:
    """Size of a figure [inch] whose picture has the sides ``width : height``, with space for labels."""
    side = 5.4 / max(width, height, 1e-300)
    return max(4.6, width * side + beside), max(1.8, height * side) + below


def signed(value: float) -> str:
    """Four decimals with a typographic sign."""
    return f"{value:+.4f}".replace("-", "−")
