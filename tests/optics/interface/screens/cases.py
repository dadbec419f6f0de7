"""A stream in memory that screens are printed to."""

import io


class Stream(io.StringIO):
    """A stream that says whether it is a terminal, and how it is encoded."""

    def __init__(self, terminal=False, encoding="utf-8"):
        super().__init__()
        self.terminal, self.told = terminal, encoding

    encoding = property(lambda self: self.told)

    def isatty(self):
        return self.terminal
