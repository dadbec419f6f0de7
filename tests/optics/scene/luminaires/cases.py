"""Luminaires for the tests, and the texts of small files."""

import numpy as np

from optics.scene.luminaires import Luminaire, Opening

C = np.array([0.0, 15.0, 40.0, 90.0, 130.0, 180.0, 260.0, 300.0, 360.0])
GAMMA = np.array([0.0, 5.0, 20.0, 45.0, 60.0, 90.0, 120.0, 180.0])


OPENING = Opening((60.0, 20.0))


def asymmetric(opening=OPENING):
    """Return a luminaire without any symmetry, brighter towards C = 40, with some light upwards."""
    turn, tilt = np.radians(C)[:, None], np.radians(GAMMA)[None, :]
    candela = 100 * (1 + np.cos(tilt)) * (1 + 0.6 * np.sin(tilt) * np.cos(turn - np.radians(40)))
    candela[:, 1] += 20 * np.sin(2 * turn[:, 0])
    candela[-1] = candela[0]
    return Luminaire(C, GAMMA, candela, opening)


def narrow():
    """Return the light of a point within 18 degrees, brighter towards C = 40."""
    gamma = np.array([0.0, 4.0, 9.0, 14.0, 18.0])
    across = np.cos(np.radians(C - 40))[:, None] * gamma / 20
    return Luminaire(C, gamma, 100 * (1 + across) * (1 - gamma / 20))


def lambertian(peak=100.0, step=1.0):
    """Return a luminaire of peak cos(gamma) cd below, whose flux is pi peak but for interpolation."""
    gamma = np.arange(0, 90 + step / 2, step)
    return Luminaire([0.0, 360.0], gamma, peak * np.cos(np.radians(gamma)) * np.ones((2, 1)))


def ies_text(
    planes=(0,), gammas=(0, 45, 90), candela=((100, 80, 0),), first="IESNA:LM-63-2002", header="", **numbers
):
    """Return a small LM-63 text.  numbers : that differ from the usual ones of the header."""
    lines = {
        "lamps": "1",
        "lumens": "1000",
        "multiplier": "1",
        "verticals": len(gammas),
        "horizontals": len(planes),
        "kind": 1,
        "units": 2,
        "size": "0.2 0.6 0",
        "ballast": "1",
        "future": "1",
        "watts": "10",
    } | numbers
    rows = "\n".join(" ".join(map(str, row)) for row in candela)
    tilt = header or "[TEST] none\nTILT=NONE"
    return (
        f"{first}\n{tilt}\n{' '.join(map(str, lines.values()))}\n"
        f"{' '.join(map(str, gammas))}\n{' '.join(map(str, planes))}\n{rows}\n"
    )


def ldt_lines(symmetry=0, planes=(0, 90, 180, 270), gammas=(0, 45, 90), candela=None, lumens=2000.0):
    """Return the lines of a small EULUMDAT file, written by hand from the format's description."""
    rows = [[200.0, 100.0, 0.0]] * len(planes) if candela is None else candela
    return [
        *("maker", "1", str(symmetry), str(len(planes)), "0", str(len(gammas)), "0"),
        *("report", "name", "number", "file", "date"),
        *("600", "200", "50", "580", "180", "0", "0", "0", "0"),
        *("100", "80", "1", "0", "1"),
        *("1", "LED", str(lumens), "4000 K", "80", "20"),
        *["0.5"] * 10,
        *map(str, planes),
        *map(str, gammas),
        *(str(value) for row in rows for value in row),
    ]
