"""What probes of other crates have measured, against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ..errors import NotApplicableError
from ..files import samples
from .facts import sampled
from .style import headline, label

if TYPE_CHECKING:
    from ..files.recording import Recording


def draw(file: Recording) -> Figure:
    """A panel for each column of a probe, with a line for each component."""
    columns = samples.of_probes(file)
    if not columns:
        raise NotApplicableError("no probe of another crate has measured anything")
    table = file.samples
    figure = Figure(figsize=(6.4, 1.2 + 2.1 * len(columns)), layout="constrained")
    panels = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, unit, components) in zip(panels, columns):
        for component in components:
            axes.plot(table["time"], table[component], lw=1.2, label=component.removeprefix(f"{name}_"))
        axes.set_ylabel(label(name) + ("" if unit == "1" else f"\n[{unit}]"))
        if len(components) > 1:
            axes.legend(loc="best")
    panels[-1].set_xlabel("time  $t$  [time]")
    headline(figure, "Columns of probes", sampled(file, table["time"]))
    return figure
