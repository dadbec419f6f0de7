"""Laplace's equation on an L: adapted splines have the rate dof^(-degree / 2), uniform ones dof^(-1/3)."""

import numpy as np
from scipy.sparse import diags_array, linalg

from thbcad import BSplineSurface, KnotVector, THBSpace, quasi_interpolate

# two bilinear patches that meet along u = 1, where splines are only continuous; the corner is (u, v) = (1, 0)
NET = np.array([[[0, -1], [-1, -1]], [[0, 0], [-1, 1]], [[1, 0], [1, 1]]])
MAP = BSplineSurface(KnotVector(1, [0, 0, 1, 2, 2]), KnotVector(1, [0, 0, 1, 1]), NET)
TURN = np.exp(-0.75j * np.pi)  # the solution r^(2/3) sin(2/3 phi) is Re (TURN z)^(2/3), z = x + i y


def solutions(degree, most, adaptive):  # spaces, and the errors of their solutions in the energy norm
    kv_u = KnotVector(degree, np.repeat([0, 1, 2], [degree + 1, degree, degree + 1]))
    space = THBSpace(kv_u, KnotVector.uniform(degree, spans=1))
    while space.dim < most:
        fine = space.refine(space.cells)  # every cell in four: what would each of its functions gain?
        u, v, weights, _ = fine.quadrature()
        z, z_u, z_v = (MAP(u, v, order) @ [1, 1j] for order in ((0, 0), (1, 0), (0, 1)))
        area = (z_u.conj() * z_v).imag
        slope = diags_array(1j * z_v.conj() / area) @ fine.collocation(u, v, (1, 0))  # d/dx - i d/dy
        slope = slope - diags_array(1j * z_u.conj() / area) @ fine.collocation(u, v, (0, 1))
        matrix, p = (slope.conj().T @ diags_array(weights * area) @ slope).real, space.prolongation(fine)
        inner, fine_inner = ((s.greville() % (2, 1)).all(axis=1) for s in (space, fine))  # 0 on the boundary
        start = quasi_interpolate(space, lambda u, v: ((TURN * (MAP(u, v) @ [1, 1j])) ** (2 / 3)).real)
        c, coarse = np.where(inner, 0, start.coefficients), p.T @ matrix @ p  # c: on the boundary
        c[inner] = linalg.spsolve(coarse[inner][:, inner], -(coarse @ c)[inner])
        error = slope @ (p @ c) - 2 / 3 * TURN * (TURN * z) ** (-1 / 3)
        yield space, np.sqrt(weights * area @ abs(error) ** 2)
        gain = fine_inner * (matrix @ (p @ c)) ** 2 / matrix.diagonal()
        acting = fine.incidence()[:, gain > gain.max() / 10].sum(axis=1) > 0
        cells = space.locate(*(x[acting] for x in fine.quadrature(1)[:2])) if adaptive else slice(None)
        space = space.refine(space.cells[cells], admissible=2)


if __name__ == "__main__":
    for degree, adaptive in ((2, False), (2, True), (3, True)):
        for space, error in solutions(degree, 2300, adaptive):
            print(f"{degree=}, {adaptive=}: {space.dim:4} dof, {space.levels:2} levels, error {error:.5f}")
