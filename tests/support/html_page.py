"""A page as a test reads it: its elements, links and words."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Elements, checked to be closed in order, and the text of the sections with an id."""

    EMPTY = frozenset({"meta", "link", "br", "hr", "img", "input"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.sections: dict[str, str] = {}
        self._open: list[str] = []
        self._section = ""
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.EMPTY:
            self._open.append(tag)
        if tag == "section":
            self._section = dict(attrs).get("id") or ""

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.sections[self._section] = self.sections.get(self._section, "") + data + " "

    @property
    def words(self) -> str:
        """All text, in single spaces."""
        return " ".join(" ".join(self.sections.values()).split())

    @property
    def targets(self) -> list[str]:
        """Places that links lead to and pictures come from."""
        return [value or "" for _, found in self.elements for name, value in found.items() if name in ("src", "href")]
