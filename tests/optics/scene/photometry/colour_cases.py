"""The package colour-science, a second source of colours.

On import it warns of packages that it does without, and changes how numpy prints.
"""

import warnings

import numpy as np

with warnings.catch_warnings(), np.printoptions():
    warnings.simplefilter("ignore")
    import colour

__all__ = ["colour"]
