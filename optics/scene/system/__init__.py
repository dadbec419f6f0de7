"""A problem and the shape of every element: lens, source, target, light path, skips."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.system.elements import TURNED, freeforms, lens_product, pose_of
    from optics.scene.system.geometry_search import nearest_geometry
    from optics.scene.system.lens_material import absorption_at, index_at, indexing_material
    from optics.scene.system.made_bodies import body_checks, body_options
    from optics.scene.system.made_parts import (
        MadePart,
        designed_part,
        manufactured,
        other_limit_checks,
        other_parts,
        scene_parts,
        volume_of_made,
    )
    from optics.scene.system.prescribed import shared
    from optics.scene.system.reach import can_be_lit, require_lens_on_axis, require_light_of_one_lens
    from optics.scene.system.soundness import advice, load_system, solvable_system, traceable_system
    from optics.scene.system.source import Own, source_frames, source_of
    from optics.scene.system.system import System as System
    from optics.scene.system.target import LightTarget, target_irradiance

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__, renamed={"OpticalSystem": "System"})
