"""Pages of the site with all rows of each benchmark, and their list."""

from __future__ import annotations

from benchmarks.rows.pages import benchmark_tables
from scripts.docs_site.outside_files import DOCS, ROOT, with_links


def benchmark_pages() -> dict[str, str]:
    """Return {name: page}; links in their sentences are written for docs/benchmarks.md."""
    return {
        name: f"---\nhide: [toc]\n---\n{with_links(page, DOCS / 'benchmarks.md', f'benchmarks/{name}.md')}"
        for name, page in benchmark_tables(ROOT).items()
    }
