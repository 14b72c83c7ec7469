"""Small tables that notebooks show for files, frames, results and simulations."""

from __future__ import annotations

import html
from collections.abc import Iterable

from ..text import brief

__all__ = ["table"]


def table(heading: str, rows: Iterable[tuple[str, object]]) -> str:
    """A table of HTML with a heading and two columns. Texts may come from a file: markup in them shows as text."""

    def shown(text: object) -> str:
        return html.escape(brief(text, 400))

    lines = [
        f'<tr><th scope="row" style="text-align: left">{shown(name)}</th>'
        f'<td style="text-align: left">{shown(value)}</td></tr>'
        for name, value in rows
    ]
    caption = f'<caption style="text-align: left; font-weight: bold">{shown(heading)}</caption>'
    return f"<table>{caption}<tbody>{''.join(lines)}</tbody></table>"
