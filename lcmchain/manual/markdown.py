"""From the Markdown of a page to HTML: tables, anchors, coloured code, and formulas as MathML.

MathML is drawn by the browser itself, so that the pages need neither network nor script.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from latex2mathml.converter import convert
from markdown_it import MarkdownIt
from mdit_py_plugins.anchors import anchors_plugin
from mdit_py_plugins.dollarmath import dollarmath_plugin
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_by_name

if TYPE_CHECKING:
    from markdown_it.token import Token

#: Languages of code blocks that are coloured; every other block is plain text.
COLOURED = ("toml", "python")


class Heading(NamedTuple):
    """A heading of a page: its level, its anchor and its text."""

    level: int
    anchor: str
    text: str


class Rendered(NamedTuple):
    """A page as HTML, its headings, and the targets of its links and pictures as written."""

    html: str
    headings: list[Heading]
    links: list[str]
    pictures: list[str]


def anchor_of(text: str) -> str:
    """Return the anchor of a heading; the same as that of common viewers of repositories."""
    return re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")


def mathml(formula: str, *, display: bool) -> str:
    """Return a LaTeX formula as MathML."""
    return convert(formula.strip(), display="block" if display else "inline")


def render(text: str) -> Rendered:
    """Render the Markdown of a page; links to pages ``name.md`` become links to ``name.html``."""
    parser = _parser()
    tokens = parser.parse(text)
    links, pictures = [], []
    for token in _all_tokens(tokens):
        if token.type == "link_open":
            links.append(str(token.attrs["href"]))
            token.attrs["href"] = _html_target(links[-1])
        elif token.type == "image":
            pictures.append(str(token.attrs["src"]))
    html = parser.renderer.render(tokens, parser.options, {})
    html = html.replace("<table>", '<div class="table"><table>')
    html = html.replace("</table>", "</table></div>")
    return Rendered(html, _headings(tokens), links, pictures)


def plain_text(text: str) -> str:
    """Return the words of a page without markup, for the search."""
    words = [
        token.content
        for token in _all_tokens(_parser().parse(text))
        if token.type in ("text", "code_inline", "fence", "code_block")
    ]
    return " ".join(" ".join(words).split())


def code_style() -> str:
    """Return the style sheet of coloured code."""
    light = HtmlFormatter(style="default").get_style_defs(".highlight")
    return re.sub(r"^\.highlight \{.*\}\n", "", light, flags=re.MULTILINE)


@lru_cache(maxsize=1)
def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": False, "highlight": _highlighted}).enable("table")
    parser.use(anchors_plugin, max_level=4, slug_func=anchor_of)
    parser.use(
        dollarmath_plugin,
        allow_space=False,
        allow_digits=False,
        renderer=lambda formula, options: mathml(formula, display=options["display_mode"]),
    )
    return parser


def _highlighted(code: str, language: str, _attributes: str) -> str:
    if language not in COLOURED:
        return ""  # the parser escapes and wraps it
    coloured = highlight(code, get_lexer_by_name(language), HtmlFormatter(nowrap=True))
    return f'<pre class="highlight"><code>{coloured}</code></pre>'


def _all_tokens(tokens: list[Token]):
    for token in tokens:
        yield token
        yield from _all_tokens(token.children or [])


def _headings(tokens: list[Token]) -> list[Heading]:
    return [
        Heading(
            int(token.tag[1]),
            str(token.attrs["id"]),
            "".join(part.content for part in tokens[i + 1].children or []),
        )
        for i, token in enumerate(tokens)
        if token.type == "heading_open"
    ]


def _html_target(link: str) -> str:
    return re.sub(r"^([\w-]+)\.md(?=#|$)", r"\1.html", link)
