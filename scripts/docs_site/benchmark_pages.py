"""Pages of the site with all rows of each benchmark, and their list."""

from __future__ import annotations

from benchmarks.rows.pages import benchmark_tables
from scripts.docs_site.outside_files import ROOT


def benchmark_pages() -> dict[str, str]:
    """Return {name: page}."""
    return {name: f"---\nhide: [toc]\n---\n{page}" for name, page in benchmark_tables(ROOT).items()}
