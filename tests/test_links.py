"""Links and anchors of pages, notebooks and kept HTML lead somewhere, on a code host and in the site."""

import json
import posixpath
import re

import pytest

from scripts.docs_site.made_pages import generated_pages, outside_places, page_text
from scripts.docs_site.outside_files import DOCS, PAGES
from tests.cases import EXAMPLES, ROOT

TOP = sorted(ROOT.glob("*.md"))
FILES = [
    *TOP,
    *sorted(DOCS.rglob("*.md")),
    *sorted(DOCS.rglob("*.html")),
    *sorted(EXAMPLES.rglob("*.ipynb")),
]
MADE = {"build", "dist", "exports", ".venv"}  # folders that no checkout has
CODE = re.compile(r"^( *)```.*?^\1```|`[^`\n]*`", re.DOTALL | re.MULTILINE)
FENCED = re.compile(r"^( *)```.*?^\1```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(<?([^)\s>]+)>?[^)]*\)|^\[[^]]+\]: +(\S+)", re.MULTILINE)
EQUATION = re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$", re.DOTALL)
ATTRIBUTE = re.compile(r'\s(?:src|href)="([^"]*)"')
HEADING = re.compile(r"^#{1,6} +(.*?)(?: \{#([^}\s]+)\})?$", re.MULTILINE)
IDENTIFIER = re.compile(r'\sid="([^"]*)"')
ELSEWHERE = re.compile(r"[a-z]+:|//")  # another host, or a picture within the page
ON_HOST, IN_SITE = "-", "_"  # what stands before the number of a heading that occurs again


def markdown_of(path):
    """Return the text of a page, of a notebook that of its cells in Markdown."""
    text = path.read_text("utf-8")
    if path.suffix != ".ipynb":
        return text
    cells = json.loads(text)["cells"]
    return "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")


def links_of(text, html=False):
    """Return the targets of a page that do not lie on another host."""
    found = [] if html else [a or b for a, b in LINK.findall(CODE.sub("", text))]
    found += ATTRIBUTE.findall(text if html else CODE.sub("", text))
    return [target for target in found if not ELSEWHERE.match(target)]


def slug(heading):
    """Return the anchor of a heading as code hosts and the site make it."""
    words = re.sub(r"!?\[([^]]*)\]\([^)]*\)|<[^>]*>", r"\1", heading)
    return re.sub(r"[^\w\- ]", "", words.strip().lower()).replace(" ", "-")


def anchors_of(text, again=ON_HOST):
    """Return the anchors of a page: its headings, the second of a name with a number, and its ids."""
    anchors = set(IDENTIFIER.findall(text))
    seen = {}
    for words, name in HEADING.findall(FENCED.sub("", text)):
        anchor = name or slug(words)
        seen[anchor] = seen.get(anchor, -1) + 1
        anchors.add(f"{anchor}{again}{seen[anchor]}" if seen[anchor] else anchor)
    return anchors


def test_anchors_are_those_of_code_hosts():
    text = "# A *b* `c_d`: e/f\n\n```\n# g\n```\n## A b c_d ef\n### h {#i}\n<span id='j'></span> <a id=\"k\">"
    assert anchors_of(text) == {"a-b-c_d-ef", "a-b-c_d-ef-1", "i", "k"}
    assert "a-b-c_d-ef_1" in anchors_of(text, IN_SITE)


def leads_somewhere(path, target):
    """Return whether a link of a file leads to a file of every checkout, and to an anchor there."""
    place, _, anchor = target.partition("#")
    file = (path.parent / place).resolve() if place else path
    if not file.exists() or not file.is_relative_to(ROOT) or MADE & {*file.relative_to(ROOT).parts}:
        return False
    return not anchor or (file.is_file() and anchor in anchors_of(markdown_of(file)))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_of_a_file_lead_to_files_and_anchors_of_the_checkout(path):
    links = links_of(markdown_of(path), path.suffix == ".html")
    assert [target for target in links if not leads_somewhere(path, target)] == []


def site_pages():
    """Return the pages of the site as {place: text that MkDocs gets}."""
    generated = generated_pages()
    own = {path.relative_to(DOCS).as_posix(): path.read_text("utf-8") for path in DOCS.rglob("*.md")}
    own |= {place: generated[place] for place in PAGES.values()}
    return generated | {place: page_text(text, place) for place, text in own.items()}


def site_places():
    """Return where files lie in the site that are no pages of its own: those of docs/, and linked ones."""
    sources = {path: path.read_text("utf-8") for path in [*DOCS.rglob("*.md"), *PAGES]}
    kept = [path for path in DOCS.rglob("*") if path.is_file() and path.suffix != ".md"]
    return {path.relative_to(DOCS).as_posix() for path in kept} | {*outside_places(sources)}


def test_links_of_the_site_lead_to_its_files_and_anchors():
    pages, files = site_pages(), site_places()
    anchors = {place: anchors_of(text, IN_SITE) for place, text in pages.items()}
    dead = []
    for page, text in pages.items():
        for target in links_of(text):
            place, _, anchor = target.partition("#")
            place = posixpath.normpath(posixpath.join(posixpath.dirname(page), place)) if place else page
            known = place in pages or place in files
            if not known or (anchor and anchor not in anchors.get(place, ())):
                dead.append((page, target))
    assert dead == []


def test_the_site_leaves_no_file_of_docs_out():
    """MkDocs does not warn of a link to a file that `exclude_docs` names: 34 led nowhere."""
    assert "exclude_docs" not in (ROOT / "mkdocs.yml").read_text("utf-8")


def test_no_command_of_an_equation_has_two_backslashes():
    """Two end a line, and a blank or an end of line follows; within JSON each of them is written twice."""
    equations = [
        (path.name, found[0])
        for path in FILES
        if path.suffix != ".html"
        for found in EQUATION.finditer(CODE.sub("", markdown_of(path)))
    ]
    assert len(equations) > 20
    assert [(name, tex) for name, tex in equations if re.search(r"\\\\(?=\S)", tex)] == []
