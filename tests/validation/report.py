"""The record: validation.json has the measurements part by part.

validation.md, validation-rough-shear.md and validation.png present the z-scores, validation-bounds.md what only has a
bound.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

from haff.figures.style import BLUE, CYCLE, GREY, RED, style

from .registry import Part
from .rows import Z_LIMIT, Row, chi_square

# Quantities that were compared or measured by another method before; docs/validation.md describes each.
LOST = [
    "| idea | ratio | where |",
    "|---|---|---|",
    "| Pressure of dense disks from the Padé approximant of ten virial coefficients | Z = 8.342, measured 8.312 ± 0.002"
    " | φ = 0.648; Luding's fit replaces it |",
    "| a₂ from the formula of Montanero and Santos, which leaves out higher coefficients"
    " | at e = 0.8 −0.0127 instead of −0.0146 ± 0.0002, at e = 0.5 0.0498 instead of 0.0478 ± 0.0002"
    " | velocity distribution; a table from the Boltzmann equation replaces it |",
    "| a₂ from the formula of van Noije and Ernst | at e = 0.8 −0.0126 instead of −0.0146 ± 0.0002, at e = 0.5 0.0525"
    " instead of 0.0478 ± 0.0002 | the same |",
    "| Slope of the mean square displacement between 15 and 40 mean free times | 0.93"
    " | 4000 spheres, φ = 0.37: the long-time tail is not over |",
    "| Pressure from the first 400 collisions per particle after a random start | 0.998 | disks, φ = 0.65 |",
]


SECOND = 120
"""Parts of this order and above have their scores on a page of their own, so that pages stay short."""


def load(path: Path) -> dict[str, Any]:
    """The record so far; parts that are not measured again are kept."""
    return json.loads(path.read_text()) if path.exists() else {"parts": {}}


def rows_of(stored: dict[str, Any]) -> list[Row]:
    """The rows of a part of a record."""
    return [Row.from_json(row) for row in stored["rows"]]


def write(record: dict[str, Any], directory: Path, parts: dict[str, Part]) -> None:
    """Writes validation.json, its pages and validation.png."""
    directory.mkdir(parents=True, exist_ok=True)
    # In the order of the record, not of measurement.
    record["parts"] = {name: record["parts"][name] for name in parts if name in record["parts"]}
    (directory / "validation.json").write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    (directory / "validation.md").write_text(markdown(record, parts))
    (directory / "validation-rough-shear.md").write_text(second_page(record, parts))
    (directory / "validation-bounds.md").write_text(bounds_page(record))
    figure(record, parts, directory / "validation.png")


def digits(value: float, error: float) -> str:
    """A number to two digits of its error."""
    if not math.isfinite(value):
        return str(value)
    if error <= 0 or not math.isfinite(error):
        return f"{value:.6g}"
    places = 1 - math.floor(math.log10(error))
    if abs(value) >= 1e5 or (value != 0 and abs(value) < 1e-4):
        scale = math.floor(math.log10(abs(value)))
        return f"{value:.{max(places + scale, 0)}e}"
    return f"{value:.{max(places, 0)}f}"


def table(rows: list[Row]) -> list[str]:
    """Rows as a Markdown table."""
    lines = ["| system | quantity | measured | expected | z | compared with |", "|---|---|---|---|---|---|"]
    for row in rows:
        mark = "" if row.passed else " **fails**"
        if row.bound:
            cells = [f"{row.measured:.2g}", f"≤ {row.expected:.2g}", "kept" if row.passed else "**fails**"]
        else:
            measured = digits(row.measured, row.error) + (f" ± {row.error:.1e}" if row.error else "")
            expected = digits(row.expected, row.uncertainty or row.error)
            expected += f" ± {row.uncertainty:.1e}" if row.uncertainty else ""
            cells = [measured, expected, f"{row.z:+.1f}{mark}"]
        lines.append("| " + " | ".join([row.system, row.quantity, *cells, row.source]) + " |")
    return lines


def summary(rows: list[Row]) -> str:
    """Number of rows passed, and their χ²."""
    total, count, probability = chi_square(rows)
    passed = sum(row.passed for row in rows)
    text = f"{passed} of {len(rows)} passed"
    return text + (f"; χ² = {total:.1f} for {count} z-scores (p = {probability:.2f})" if count else "")


def markdown(record: dict[str, Any], parts: dict[str, Part]) -> str:
    """The record as a page: every part and every z-score."""
    stored = {name: rows_of(part) for name, part in record["parts"].items()}
    everything = [row for rows in stored.values() for row in rows]
    lines = [
        "# Validation",
        "",
        "Written by `scripts/validate`; [docs/validation.md](../../docs/validation.md) explains the figures, and",
        "validation.json has every row; [validation-bounds.md](validation-bounds.md) has the quantities that only have",
        "a bound, and [validation-rough-shear.md](validation-rough-shear.md) the scores of rough and sheared gases.",
        "*Measured* is the mean of independent runs with its standard error; *expected*",
        "has the uncertainty of the theory or of the published figure, added in quadrature; z is the deviation in this",
        f"combined error (for few runs, from Student's t). A figure passes if |z| < {Z_LIMIT:g}.",
        "",
        f"All: {summary(everything)}.",
        "",
        "![z-scores](validation.png)",
        "",
        "## Parts",
        "",
        "`scripts/validate NAME` measures one part again; the others stay as they are.",
        "",
    ]
    for name, part in record["parts"].items():
        effort = f"{part['collisions']:.2g} collisions in {part['seconds']:.0f} s, {part['jobs']} runs at once"
        lines.append(
            f"- **{parts[name].title}** (`{name}`). {parts[name].about} *{summary(stored[name])}. {effort},"
            f" on {part['machine']}, haff {part['version']}, {part['date']}.*"
        )
    found = scored({name: rows for name, rows in stored.items() if parts[name].order < SECOND})
    lines += ["", "## Figures with a z-score", "", *found] if found else []
    lines += ["", "## Tried and lost", "", *LOST]
    return "\n".join(lines) + "\n"


def second_page(record: dict[str, Any], parts: dict[str, Part]) -> str:
    """The z-scores of the parts from :data:`SECOND` on as a page."""
    stored = {name: rows_of(part) for name, part in record["parts"].items() if parts[name].order >= SECOND}
    lines = [
        "# Validation: rough and sheared gases",
        "",
        "Written by `scripts/validate`; [validation.md](validation.md) describes the parts and the columns.",
        "",
        *scored(stored),
    ]
    return "\n".join(lines) + "\n"


def bounds_page(record: dict[str, Any]) -> str:
    """The quantities that only have a bound as a page: of each the worst case."""
    stored = {name: rows_of(part) for name, part in record["parts"].items()}
    lines = [
        "# Validation: bounds",
        "",
        "Written by `scripts/validate`. Quantities without a statistical error, which must not exceed a bound, and of",
        "each the case that is closest to it; [validation.md](validation.md) describes the parts.",
        "",
        *bounds(stored),
    ]
    return "\n".join(lines) + "\n"


def scored(stored: dict[str, list[Row]]) -> list[str]:
    """All rows with a z-score as one table."""
    lines = []
    for name, rows in stored.items():
        _, _, *body = table([row for row in rows if not row.bound])
        lines += [f"| {name} {line}" for line in body]
    head = ["| part | system | quantity | measured | expected | z | compared with |", "|---|---|---|---|---|---|---|"]
    return head + lines if lines else []


def bounds(stored: dict[str, list[Row]]) -> list[str]:
    """The worst case of each bounded quantity: one that fails, or the one that comes closest to its bound."""
    lines = []
    for name, rows in stored.items():
        cases: dict[str, list[Row]] = {}
        for row in rows:
            if row.bound:
                cases.setdefault(row.quantity, []).append(row)
        for quantity, found in cases.items():
            worst = max(found, key=lambda row: (not row.passed, row.measured / row.expected if row.expected else 0.0))
            failed = sum(not row.passed for row in found)
            kept = f"**fails** in {failed}" if failed else "kept"
            lines.append(
                f"| {name} | {quantity} | {len(found)} | {worst.measured:.2g} | ≤ {worst.expected:.2g}"
                f" | {worst.system} | {worst.source} | {kept} |"
            )
    head = ["| part | quantity | cases | worst | bound | in | set by | |", "|---|---|---|---|---|---|---|---|"]
    return head + lines if lines else []


def figure(record: dict[str, Any], parts: dict[str, Part], path: Path) -> None:
    """All z-scores, part by part, and their distribution."""
    names = [name for name in record["parts"] if any(not row.bound for row in rows_of(record["parts"][name]))]
    if not names:
        return
    with style():
        drawn, (axis, side) = plt.subplots(
            1, 2, figsize=(7.4, 0.42 * len(names) + 1.3), sharey=False, width_ratios=[3, 1.2], layout="constrained"
        )
        scores = {name: [row.z for row in rows_of(record["parts"][name]) if not row.bound] for name in names}
        for row_index, name in enumerate(names):
            z = np.clip(scores[name], -6, 6)
            spread = np.linspace(-0.22, 0.22, len(z)) if len(z) > 1 else [0.0]
            axis.plot(z, row_index + np.asarray(spread), "o", color=CYCLE[row_index % len(CYCLE)], markersize=3.5)
        axis.axvspan(-1, 1, color="0.5", alpha=0.18, linewidth=0)
        for limit in (-Z_LIMIT, Z_LIMIT):
            axis.axvline(limit, color=RED, linestyle="--", linewidth=1)
        axis.set_yticks(range(len(names)), [parts[name].title for name in names])
        axis.set(xlim=(-5, 5), ylim=(len(names) - 0.5, -0.5), xlabel="z = (measured − expected)/error")
        axis.grid(axis="y", visible=False)
        everything = np.concatenate([scores[name] for name in names])
        side.hist(everything, bins=np.arange(-4.5, 5, 1.0), density=True, color=GREY, alpha=0.5)
        x = np.linspace(-4.5, 4.5, 200)
        side.plot(x, stats.norm.pdf(x), color=BLUE, linewidth=1.2, label="normal")
        side.set(xlabel="z", ylabel="density", title=f"{len(everything)} z-scores")
        side.legend(loc="upper left", fontsize=7, handlelength=1)
        drawn.savefig(path, dpi=150)
        plt.close(drawn)
