"""Notes of a run: kept for its record and report, and told at once to whoever listens."""

from __future__ import annotations

from collections.abc import Callable, Iterable


class Notes(list[str]):
    """Sentences in the order in which they came; call it to add one.

    listener : called with every new sentence.
    """

    def __init__(
        self, sentences: Iterable[str] = (), listener: Callable[[str], object] | None = None
    ) -> None:
        super().__init__(sentences)
        self._listener = listener

    def __call__(self, sentence: str) -> None:
        if sentence not in self:
            self.append(sentence)
            if self._listener is not None:
                self._listener(sentence)
