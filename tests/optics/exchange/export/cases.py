"""The files that a command left."""


def names(folder):
    return sorted(p.name for p in folder.iterdir())
