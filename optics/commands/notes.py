"""Notes of a run: printed at once, and kept for its record and report."""

from __future__ import annotations

from optics.runtime import note


class Notes(list[str]):
    """Sentences in the order in which they came; call it to add one, which is then printed on stderr."""

    def __call__(self, sentence: str) -> None:
        if sentence not in self:
            note(sentence)
            self.append(sentence)
