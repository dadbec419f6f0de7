"""Records that are values: what holds the same is the same."""

from collections.abc import Callable
from dataclasses import fields
from functools import cached_property, partial
from typing import Any

import numpy as np


class Value:
    """A frozen dataclass (`eq=False`) that is what it holds: equal, with equal hashes, where its fields are.

    Copies and pickles are made by the constructor, with read-only arrays and without caches.
    """

    def _arguments(self) -> dict[str, Any]:
        """Return the arguments of the constructor that make it again."""
        record: Any = self
        return {field.name: getattr(self, field.name) for field in fields(record) if field.init}

    def _content(self) -> tuple[Any, ...]:
        """Return what tells it from others of its type: arrays, and what can be compared and hashed."""
        return tuple(self._arguments().values())

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        own, others = self._content(), other._content()
        return self is other or (
            len(own) == len(others)
            and all(
                np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in zip(own, others)
            )
        )

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # the sum turns -0.0 into 0.0, which is equal to it
        rows = ((x.shape, (x + 0).tobytes()) if isinstance(x, np.ndarray) else x for x in self._content())
        return hash((type(self), *rows))

    def __reduce__(self) -> tuple[Callable[[], Any], tuple[()]]:
        return partial(type(self), **self._arguments()), ()
