"""Hooks of the site (mkdocs.yml): files of the repository that pages link to come along."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.structure.files import File, InclusionLevel

ROOT = Path(__file__).resolve().parents[1]
# Where files from outside of docs/ stand on the site.
OUTSIDE = "repository/"
LINK = re.compile(r"(!?\[(?P<text>[^\]]*)\])\((?P<target>[^)\s#:]+)(?P<rest>#[^)\s]*)?\)")


def on_files(files, config):
    """Adds whatever the pages link to outside of docs/."""
    in_nav = set(named_in(config.nav))
    # A new page has a place, even before it is named in mkdocs.yml.
    if more := [file.src_uri for file in files.documentation_pages() if file.src_uri not in in_nav]:
        config.nav.append({"More": sorted(more)})
    waiting = list(in_nav)
    for file in files.documentation_pages():
        waiting += links(file.src_uri, file.content_string)
    seen = set()
    while waiting:
        path = waiting.pop()
        source = ROOT / path.removeprefix(OUTSIDE)
        if path in seen or not path.startswith(OUTSIDE) or not source.is_file():
            continue
        seen.add(path)
        level = InclusionLevel.INCLUDED if path in in_nav else InclusionLevel.NOT_IN_NAV
        files.append(File.generated(config, path, content=source.read_bytes(), inclusion=level))
        if path.endswith(".md"):
            waiting += links(path, source.read_text(encoding="utf-8"))
    return files


def on_page_markdown(markdown, page, config, files):
    """Redirects links that leave docs/ to the copies on the site; folders have no page, so only their names stay."""
    here = page.file.src_uri

    def turn(match):
        path = site_place(here, match["target"])
        if not path.startswith(OUTSIDE):
            return match[0]
        if (ROOT / path.removeprefix(OUTSIDE)).is_dir():
            return match["text"]
        target = posixpath.relpath(path, posixpath.dirname(here) or ".")
        return f"{match[1]}({target}{match['rest'] or ''})"

    return LINK.sub(turn, markdown)


def named_in(nav):
    """Paths of the pages in the navigation."""
    for entry in nav:
        for value in entry.values() if isinstance(entry, dict) else [entry]:
            yield from named_in(value) if isinstance(value, list) else [value]


def links(page, text):
    """Places on the site of what a page links to."""
    return [site_place(page, match["target"]) for match in LINK.finditer(text)]


def site_place(page, target):
    """Place on the site of a link's target."""
    if page.startswith(OUTSIDE):
        in_repository = posixpath.join(posixpath.dirname(page.removeprefix(OUTSIDE)), target)
    else:
        in_repository = posixpath.join("docs", posixpath.dirname(page), target)
    in_repository = posixpath.normpath(in_repository)
    if in_repository.startswith("docs/"):
        return in_repository.removeprefix("docs/")
    return OUTSIDE + in_repository
