"""The page of benchmarks as one page for each benchmark, and an overview."""

from __future__ import annotations

import re

SECTION = re.compile(r"^## (\w+)\n", re.MULTILINE)


def benchmark_pages(text: str) -> dict[str, str]:
    """Return {name: page} from docs/benchmarks.md; the page "" is the overview."""
    introduction, *parts = SECTION.split(text)
    sections = dict(zip(parts[::2], parts[1::2], strict=True))
    sentences = {name: body.strip().split("\n\n")[0] for name, body in sections.items()}
    rows = [f"| [{name}](benchmarks/{name}.md) | {sentence} |" for name, sentence in sentences.items()]
    overview = "\n".join(
        [introduction.rstrip(), "", "| benchmark | what it measures |", "|---|---|", *rows, ""]
    )
    return {"": overview} | {
        name: f"---\nhide: [toc]\n---\n# {name}\n{body}" for name, body in sections.items()
    }
