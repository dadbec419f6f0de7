"""What a problem describes, built once: lens, source, target, and what tracing need not compute."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.system.lens import (
        base_lens as base_lens,
        freeforms as freeforms,
        lens_product as lens_product,
        problem_rays as problem_rays,
        ray_parts as ray_parts,
        source_profile as source_profile,
        target_irradiance as target_irradiance,
        target_light as target_light,
        target_screen as target_screen,
    )
    from optics.system.soundness import (
        advice as advice,
        sound as sound,
    )
    from optics.system.tracing_skips import (
        skip_lines as skip_lines,
        skips as skips,
    )

_FILES = {
    "lens": (
        "base_lens",
        "freeforms",
        "lens_product",
        "problem_rays",
        "ray_parts",
        "source_profile",
        "target_irradiance",
        "target_light",
        "target_screen",
    ),
    "soundness": (
        "advice",
        "sound",
    ),
    "tracing_skips": (
        "skip_lines",
        "skips",
    ),
}
__getattr__, __dir__, __all__ = lazy_door(__name__, _FILES)
