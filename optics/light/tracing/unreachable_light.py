"""What is wrong with a light path, said from a trace: light that never meets what it is to meet next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from optics.base.runtime import Backend
from optics.light.tracing.sequential import Tracer
from optics.scene.paths import LightPath
from optics.scene.sources import Rays

SHARE = 0.01  # of the traced light, above which a fault is said
GRAZING = np.sin(np.radians(1.0))  # of light that runs along the receiver
ON_SURFACE = 1e-9  # of the half-width: no ray starts behind a surface that it starts on


def path_faults(backend: Backend, path: LightPath, rays: Rays) -> list[str]:
    """Return sentences on light that cannot go as a path says; none where all is well.

    What passes beside a surface, or is reflected totally, is no fault: the fates say it.
    """
    return [
        f"{share:.0%} of the light {text}" for text, share in _shares(backend, path, rays) if share > SHARE
    ]


def _shares(backend: Backend, path: LightPath, rays: Rays) -> Iterator[tuple[str, float]]:
    """Yield what may happen to light, and to which share of all light it does."""
    landing = Tracer(backend, path, rays).landed()
    none = np.zeros(rays.flux.size)
    total, coming = path.share * rays.total, path.share * rays.flux
    for k, (surface, passage) in enumerate(zip(path.surfaces, landing.passages)):
        origin, direction = (
            np.stack([np.asarray(a.numpy()) + none for a in v])
            for v in (passage.before.origin, passage.before.direction)
        )
        backward = direction[2] <= 0
        x, y, z = origin
        hx, hy = surface.shape.half_width
        over = surface.shape.outline.contains(x, y)
        height = surface.shape(np.clip(x, -hx, hx), np.clip(y, -hy, hy))
        behind = ~backward & over & (z > height + ON_SURFACE * max(hx, hy))
        yield f"comes to surface {k} from behind; turn the surface round", coming[backward].sum() / total
        text = f"meets surface {k} before surface {k - 1}; exchange them, or move one"
        if k == 0:
            text = "starts behind the first surface, in the solid or beyond it; move the source back"
        yield text, coming[behind].sum() / total
        coming = passage.leaving.numpy() + none
    arriving, blocked = landing.flux.numpy() + none, none > 0
    if not isinstance(landing.blocked, bool):
        blocked = landing.blocked.numpy()
    cosine = np.sqrt(np.maximum(1 - landing.p.numpy() ** 2 - landing.q.numpy() ** 2, 0.0))
    behind = (coming - arriving)[~blocked].sum() / total
    yield "comes to the receiver from behind; turn the receiver round", behind
    yield (
        "runs along the receiver, within a degree; tilt the receiver",
        arriving[cosine < GRAZING].sum() / total,
    )
