"""Keys of a problem file: records of tables, their limits, names and changes; and as TOML again."""

from thbcad.doors import TYPE_CHECKING, lazy_door

if TYPE_CHECKING:
    from optics.scene.keys.dead_ends import cannot_do
    from optics.scene.keys.dotted_keys import Key, keys_of, lists_tables, table_of
    from optics.scene.keys.key_changes import assignment, with_changes
    from optics.scene.keys.key_effects import require_effects
    from optics.scene.keys.toml_records import (
        AUTO,
        FARTHEST,
        LONGEST,
        SHORTEST,
        Rows,
        checked_values,
        option,
        record,
    )
    from optics.scene.keys.toml_text import problem_to_toml, toml_value

__getattr__, __dir__, __all__ = lazy_door(__name__, __file__)
