"""Links of a built site that lead nowhere within it: python site_links.py SITE.

Beside ``mkdocs build --strict``, which is silent about links to files that the site leaves out.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """What a page links to, and the places in it that can be linked to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places = {""}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for key, value in attrs:
            if key in ("href", "src") and value:
                self.links.append(value)
            elif key in ("id", "name") and value:
                self.places.add(value)


def broken_links(site: Path) -> list[str]:
    """``PAGE: LINK`` for each link whose file or place in a page is not in the site's folder."""
    pages = {
        path.resolve(): _Page(path.read_text(encoding="utf-8"))
        for path in sorted(site.rglob("*.html"))
        if path.name != "404.html"  # its links begin at the address that the site is given later
    }
    broken = []
    for page, content in pages.items():
        for link in content.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            if target.is_dir():
                target /= "index.html"
            place = unquote(parts.fragment)
            in_page = target not in pages or place in pages[target].places
            if not target.is_file() or not in_page:
                broken.append(f"{page.relative_to(site.resolve())}: {link}")
    return broken


def main() -> None:
    """Print what is broken, and end with 1 where something is."""
    broken = broken_links(Path(sys.argv[1]))
    print(*broken, sep="\n")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
