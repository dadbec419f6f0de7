"""The materials that are known without a catalogue.

Laws of dispersion are those of the papers named beside them, as refractiveindex.info prints them; there
wavelengths are in micrometres.  Of plastics they go on to 380 nm, somewhat below what was measured.
Density, dn/dT and expansion are of data sheets, at room temperature.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

from optics.scene.materials.material_record import Material, tabulated

Law = Callable[[float], float]  # n by wavelength


def _of_nm(law: Law) -> Law:
    """Return a law by nm.  law : by w in micrometres, as authors print it."""
    return lambda nm: law(nm / 1000)


def sellmeier(*terms: tuple[float, float]) -> Law:
    """Return n with n^2 = 1 + sum_i B_i w^2 / (w^2 - C_i).  terms : (B_i, C_i in um^2)."""
    return _of_nm(lambda um: sqrt(1 + sum(b * um**2 / (um**2 - c) for b, c in terms)))


def power_law(constant: float, *terms: tuple[float, int]) -> Law:
    """Return n with n^2 = A + sum_i A_i w^p_i.  terms : (A_i, p_i)."""
    return _of_nm(lambda um: sqrt(constant + sum(a * um**p for a, p in terms)))


def cauchy(constant: float, *terms: float) -> Law:
    """Return n = A + sum_i A_i / w^(2 i).  terms : A_1, A_2, ..."""
    return _of_nm(lambda um: constant + sum(a / um ** (2 * i) for i, a in enumerate(terms, 1)))


# k of SCHOTT's catalogue (2017-01-20b), from its internal transmittances
N_BK7_EXTINCTION = (
    (380.0, 2.0740e-8),
    (390.0, 1.3731e-8),
    (400.0, 1.0227e-8),
    (405.0, 9.0558e-9),
    (420.0, 9.3912e-9),
    (436.0, 1.1147e-8),
    (460.0, 1.0286e-8),
    (500.0, 9.5781e-9),
    (546.0, 6.9658e-9),
    (580.0, 9.2541e-9),
    (620.0, 1.1877e-8),
    (660.0, 1.2643e-8),
    (700.0, 8.9305e-9),
    (1060.0, 1.0137e-8),
    (1530.0, 9.8390e-8),
)


_ALL = (
    Material(
        name="PMMA",
        law=power_law(
            2.1778,
            (6.1209e-3, 2),
            (-1.5004e-3, 4),
            (2.3678e-2, -2),
            (-4.2137e-3, -4),
            (7.3417e-4, -6),
            (-4.5042e-5, -8),
        ),
        range=(380.0, 1620.0),
        measured=(420.0, 1620.0),
        source="Beadie et al., Appl. Opt. 54, F139 (2015), 20 C",
        accuracy=2e-3,  # measurements of other grades lie so far away (Sultanova 2009, Szczurowski 2013)
        density=1.19,
        dn_dt=-1.0e-4,  # this and the two below: Osaka Gas Chemicals, data sheet of OKP4, for comparison
        expansion=6e-5,
    ),
    Material(
        name="PC",
        law=sellmeier((1.4182, 0.021304)),
        range=(380.0, 1052.0),
        measured=(436.8, 1052.0),
        source="Sultanova, Kasarova, Nikolov, Acta Phys. Pol. A 116, 585 (2009), 20 C",
        accuracy=6e-3,  # so far away lies the other measurement that reaches 400 nm (Zhang 2020)
        density=1.20,
        dn_dt=-1.2e-4,
        expansion=7e-5,
    ),
    Material(
        name="COP",
        law=sellmeier((1.2969, 0.011721)),
        range=(380.0, 1052.0),
        measured=(436.8, 1052.0),
        source="Zeonex E48R: Sultanova, Kasarova, Nikolov, Acta Phys. Pol. A 116, 585 (2009), 20 C",
        accuracy=1e-3,  # of the refractometer (Sultanova, Nikolov, Ivanov, Opt. Quantum Electron. 35, 2003)
        density=1.01,
        dn_dt=-1.0e-4,
        expansion=7e-5,
    ),
    Material(
        name="N-BK7",
        law=sellmeier(
            (1.03961212, 0.00600069867),
            (0.231792344, 0.0200179144),
            (1.01046945, 103.560653),
        ),
        range=(300.0, 2500.0),
        measured=(300.0, 2500.0),
        source="SCHOTT, catalogue of 2017-01-20b, 20 C",
        accuracy=5e-4,  # of n_d as delivered where no better step is ordered (SCHOTT TIE-29)
        density=2.51,
        extinction=lambda nm: tabulated(N_BK7_EXTINCTION, nm, "the absorption of N-BK7"),
        dn_dt=1.5e-6,  # in vacuum at 550 nm, from the coefficients of the catalogue
        expansion=7.1e-6,
    ),
    Material(
        name="fused silica",
        law=sellmeier(
            (0.6961663, 0.0684043**2),
            (0.4079426, 0.1162414**2),
            (0.8974794, 9.896161**2),
        ),
        range=(210.0, 3710.0),
        measured=(210.0, 3710.0),
        source="Malitson, J. Opt. Soc. Am. 55, 1205 (1965), 20 C",
        accuracy=3e-5,  # between specimens
        density=2.20,
        dn_dt=8.7e-6,  # in vacuum, visible (Rego, Sensors 23, 6023, 2023)
        expansion=4.8e-7,  # Hahn and Kirby, AIP Conf. Proc. 3, 13 (1972), 293 K
    ),
    Material(
        name="silicone",
        law=cauchy(1.40289245, 2.43436847e-3, 1.83525764e-4),
        range=(300.0, 1690.0),
        measured=(300.0, 1690.0),
        source="Sylgard 184, 1:10: Cauchy's law through Gupta et al., ACS Appl. Mater. Interfaces 11, "
        "28189 (2019)",
        accuracy=2e-2,  # so far away lie other mixtures and cures (Schneider 2009, Zhang 2020)
        density=1.03,
    ),
)
MATERIALS = {material.name: material for material in _ALL}
