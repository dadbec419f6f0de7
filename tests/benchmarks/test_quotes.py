"""Which numbers pages quote: marks go into pages and come out of them as docs/data/quotes.toml says."""

import pytest
from hypothesis import given, strategies as st

from benchmarks.rows.quotes import FILE, marked_pages, quotes_text, without_marks
from optics.base.runtime import UserError

PAGE = """It takes 6.6 s<!-- a: time --> here, and 6.6 s<!-- b: time --> there.

| one | two |
|---|---|
| 2.7 %<!-- a: error --> | 92 %<!-- a: light --> of 92 % |
"""


@pytest.fixture
def checkout(tmp_path):
    """A function that writes a page and its quotes, and returns the folder."""

    def written(page):
        (tmp_path / FILE).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / FILE).write_text(quotes_text({"page.md": page}), "utf-8")
        (tmp_path / "page.md").write_text(without_marks(page), "utf-8")
        return tmp_path

    return written


def test_a_page_is_written_without_marks_and_read_with_them(checkout):
    root = checkout(PAGE)
    assert "<!--" not in (root / "page.md").read_text("utf-8")
    assert marked_pages(root) == {root / "page.md": PAGE}


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["in ", "in\n", "| ", ""]), st.sampled_from(["1", "12 s", "3.5 %"]), st.booleans()
        ),
        min_size=1,
        max_size=12,
    )
)
def test_every_mark_comes_back_where_it_was(tmp_path_factory, parts):
    page = "Words " + " ".join(
        f"{before}{n}{f'<!-- a: row {k} -->' * marked}" for k, (before, n, marked) in enumerate(parts)
    )
    root = tmp_path_factory.mktemp("pages")
    (root / FILE).parent.mkdir(parents=True)
    (root / FILE).write_text(quotes_text({"page.md": page}), "utf-8")
    (root / "page.md").write_text(without_marks(page), "utf-8")
    assert marked_pages(root).get(root / "page.md", without_marks(page)) == page


@pytest.mark.parametrize(
    ("page", "reason"),
    [
        ("It takes 6.7 s here.", "has 0 times the text"),
        (f"{without_marks(PAGE)}\nIt takes 6.6 s.", "has 2 times"),
    ],
)
def test_a_page_with_another_number_or_the_number_twice_is_refused(page, reason, checkout):
    root = checkout(PAGE)
    (root / "page.md").write_text(page, "utf-8")
    with pytest.raises(UserError, match=reason):
        marked_pages(root)


def test_a_page_that_is_gone_is_named(checkout):
    root = checkout(PAGE)
    (root / "page.md").unlink()
    with pytest.raises(UserError, match=r"there is no page page\.md"):
        marked_pages(root)
