"""The light of a lens by the exact tracer, for comparison."""

from optics.light.measuring import Splat
from tests.optics.cases import coefficients, target_z, tracer_to


def exact_image(backend, system, lens, rays, window):
    """Return the irradiance of a lens, (rows, columns).  rays : of the source, in x and y."""
    problem, screen = system.problem, system.target.screen()
    beam = system.source.rays(rays)
    tracer = tracer_to(backend, lens, beam, target_z(problem), absorption=problem.lens.absorption)
    _, landing = tracer.trace(coefficients(lens))
    image = Splat(backend, screen, window)(landing.x, landing.y, landing.flux)
    return image.numpy().reshape(screen.shape, order="F")
