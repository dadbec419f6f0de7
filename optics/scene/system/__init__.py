"""What a problem describes, built once: lens, source, target, and what tracing need not compute."""

from typing import TYPE_CHECKING

from thbcad.doors import lazy_door

if TYPE_CHECKING:
    from optics.scene.system.geometry_search import nearest_geometry as nearest_geometry
    from optics.scene.system.lens import freeforms as freeforms, lens_product as lens_product
    from optics.scene.system.lens_material import (
        index_at as index_at,
        indexing_material as indexing_material,
    )
    from optics.scene.system.made_parts import (
        MadePart as MadePart,
        designed_part as designed_part,
        fixed_parts as fixed_parts,
        other_limit_checks as other_limit_checks,
        scene_parts as scene_parts,
    )
    from optics.scene.system.optical_system import OpticalSystem as OpticalSystem
    from optics.scene.system.placed_faces import TURNED as TURNED, pose_of as pose_of
    from optics.scene.system.reach import (
        can_be_lit as can_be_lit,
        require_lens_on_axis as require_lens_on_axis,
    )
    from optics.scene.system.soundness import (
        advice as advice,
        load_system as load_system,
        solvable_system as solvable_system,
    )
    from optics.scene.system.source import Own as Own, source_of as source_of
    from optics.scene.system.target import (
        LightTarget as LightTarget,
        receiver_of as receiver_of,
        target_irradiance as target_irradiance,
    )
    from optics.scene.system.tracing_skips import skip_lines as skip_lines

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
