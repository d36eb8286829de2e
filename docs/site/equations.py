"""Sphinx extension: the directive `equations` makes a page of docs/equations.toml, with the lines of code and tests."""

from textwrap import dedent
from typing import Any

from docutils import nodes
from excerpts import ROOT, Document, Equation, Excerpt, documents
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Details(nodes.General, nodes.Element):
    """A box that opens with a click; `summary` is what is seen of it when closed."""


class Equations(SphinxDirective):
    """A section for each document, and one for each equation in it."""

    def run(self) -> list[nodes.Node]:
        """Makes the nodes; the page is made again when a file that it quotes has changed."""
        self.env.note_dependency(str(ROOT / "docs" / "equations.toml"))
        return [self.document(one) for one in documents()]

    def document(self, one: Document) -> nodes.section:
        """A document: its title, a note, its equations."""
        section = _section(one.title)
        section += self.parse_text_to_nodes(one.note)
        section += [self.equation(each) for each in one.equations]
        self.state.document.note_implicit_target(section, section)
        return section

    def equation(self, one: Equation) -> nodes.section:
        """An equation: formula, erratum, code, tests."""
        section = _section(f"{one.number} {one.title}" if one.number[0] == "(" else f"{one.number}: {one.title}")
        section += nodes.math_block(one.tex, one.tex, nowrap=True, number=None, label=None)
        if one.erratum:
            section += nodes.admonition(
                "", nodes.title("", "Corrected here"), *self.parse_text_to_nodes(one.erratum), classes=["warning"]
            )
        section += [self.listing("Code", each) for each in one.code]
        section += [self.listing("Test", each) for each in one.tests]
        self.state.document.note_implicit_target(section, section)
        return section

    def listing(self, kind: str, one: Excerpt) -> Details:
        """The lines, closed at first."""
        self.env.note_dependency(str(ROOT / one.file))
        text = dedent(one.text)
        block = nodes.literal_block(text, text, language="python", linenos=True)
        block["highlight_args"] = {"linenostart": one.first}
        return Details("", block, kind=kind, summary=f"{one.file}:{one.first}", name=one.name)


def _section(title: str) -> nodes.section:
    section = nodes.section(names=[nodes.fully_normalize_name(title)])
    section += nodes.title(title, title)
    return section


def _open(self: Any, node: Details) -> None:
    words = f"{node['kind']}: <code>{self.encode(node['name'])}</code>, {self.encode(node['summary'])}"
    self.body.append(f'<details class="listing"><summary>{words}</summary>\n')


def _close(self: Any, node: Details) -> None:
    del node
    self.body.append("</details>\n")


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the directive."""
    app.add_node(Details, html=(_open, _close))
    app.add_directive("equations", Equations)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
