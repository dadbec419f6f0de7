"""Bad problem files by what is wrong with them: how the small problem is changed, and what the refusal names.

A case is (name, change, key, remedy).  change : {"table.key": value}, a tuple of keys that are left out, or a
function of the good text that gives text or bytes.  key : the words that must name the place.  remedy : words
that say what to do or what is allowed.
"""

import math

NAN, INF = math.nan, math.inf
TOP_HAT = {"target.kind": "tophat"}
FORMULA = {"target.kind": "function"}
LAMP = {"source.kind": "lambertian", "source.half_width": [1.0, 1.0], "source.distance": 4.0}
BOWL = {"lens.front.radius": -20.0, "lens.front.conic": -1.0}
FRONT = "lens.front.freeform."
REAR = "lens.rear.freeform."


def _formula(text):
    return FORMULA | {"target.formula": text}


def _replaced(old, new):
    def change(text):
        assert old in text
        return text.replace(old, new, 1)

    return change


TYPES = [
    ("a pair of pairs", {"lens.rear.half_width": [[1.0], [2.0]]}, "lens.rear.half_width[0]", "a number"),
    (
        "text iterations",
        {"optimizer.iterations": "many"},
        "optimizer.iterations[0]",
        "must be a whole number",
    ),
]
RANGES = [
    ("negative thickness", {"lens.thickness": -6.0}, "lens.thickness", "must be at least 1e-06"),
    ("no thickness", {"lens.thickness": 0}, "lens.thickness", "must be at least 1e-06"),
    ("a lens of 1e300 mm", {"lens.front.half_width": [1e300, 1e300]}, "lens.front.half_width", "at most"),
    ("a lens of 1e-300 mm", {"lens.rear.half_width": [1e-300, 1.0]}, "lens.rear.half_width[0]", "at least"),
    ("a target of 1e300 mm", {"target.half_width": [1e300, 1e300]}, "target.half_width[0]", "at most 1e+09"),
    ("a target of 1e-300 mm", {"target.half_width": [1e-300, 20]}, "target.half_width[0]", "at least 1e-06"),
    ("a source of 1e-300 mm", {"source.half_width": [1e-300, 9.5]}, "source.half_width", "at least 1e-06"),
    ("index of air", {"lens.index": 1.0}, "lens.index", "must be greater than 1"),
    ("index 1e300", {"lens.index": 1e300}, "lens.index", "must be at most 10"),
    ("flux 1e200", {"source.flux": 1e200}, "source.flux", "must be at most 1e+12"),
    ("flux 1e-300", {"source.flux": 1e-300}, "source.flux", "must be at least 1e-12"),
    ("negative flux", {"source.flux": -1.0}, "source.flux", "must be at least 1e-12"),
    ("a radius of 0", {"lens.rear.radius": 0.0}, "lens.rear.radius", "must not be 0; inf is a plane"),
    ("a radius of 1e-300", {"lens.rear.radius": 1e-300}, "lens.rear.radius", "at least 0.001"),
    ("a radius of 1e300", {"lens.front.radius": -1e300}, "lens.front.radius", "at most 1e+12 in size"),
    ("conic -1e300", {"lens.rear.conic": -1e300}, "lens.rear.conic", "at most 1e+06 in size"),
    ("target at -inf", {"target.distance": -INF}, "target.distance", "must be a number or inf"),
    ("target at 1e300 mm", {"target.distance": 1e300}, "target.distance", "must be at most 1e+09"),
    ("z_freedom 1e-300", {REAR + "z_freedom": 1e-300}, REAR + "z_freedom", "must be at least 1e-06"),
    ("z_freedom of 0 in front", {FRONT + "z_freedom": 0.0}, FRONT + "z_freedom", "must be at least 1e-06"),
    ("a whole number of 100 digits", {"run.seed": 10**100}, "run.seed", "must not be larger than"),
    ("a float of 400 digits", {"lens.thickness": 10**400}, "lens.thickness", "must not be larger than"),
    ("lit more than the target", {"target.lit": [1.5, 1.0]}, "target.lit[0]", "must be at most 1"),
    ("half-angle 1e-300", LAMP | {"source.half_angle": 1e-300}, "source.half_angle", "at least 0.001"),
    ("weight 1e300", {"optimizer.roughness_weight": 1e300}, "optimizer.roughness_weight", "at most 1e+12"),
    ("negative weight", {"optimizer.lost_flux_weight": -1.0}, "optimizer.lost_flux_weight", "at least 0"),
    ("blur of a pixel", {"optimizer.blur": 1.0}, "optimizer.blur", "must be at most 0.5"),
    ("a limit of 0", {"verify.volume": 0.0}, "verify.volume", "must be greater than 0"),
    ("X-rays", {"source.wavelength": 0.1}, "source.wavelength", "must be at least 1"),
    ("slope beyond 90", {"limits.slope": 100.0}, "limits.slope", "must be at most 90"),
    ("a density of lead in kg/m^3", {"lens.density": 11340.0}, "lens.density", "must be at most 100"),
]
WORDS = [
    ("capitals", {"source.kind": "Collimated"}, "source.kind", "must be one of 'collimated'"),
    ("unknown shape", TOP_HAT | {"target.shape": "\u2b50"}, "target.shape", "must be one of 'rectangle'"),
    ("levels chosen by magic", {REAR + "max_level": "best"}, REAR + "max_level", '"auto"'),
    ("a name on two lines", {"export.product": "a\nb"}, "export.product", "line"),
    ("an author beyond reason", {"export.author": "x" * 3000}, "export.author", "characters"),
]
KEYS = [
    ("unknown key at the top", {"colour": "red"}, "colour", "the top level takes title, source"),
    ("unknown key of a table", {"lens.radius": 3.0}, "lens.radius", "[lens] takes index, thickness"),
    ("a key of another table", {"source.pixels": [8, 8]}, "source.pixels", "[source] takes kind"),
    ("unknown table", {"gadget.power": 3.0}, "gadget", "the top level takes"),
    ("key with blanks", lambda text: '" title" = "x"\n' + text, " title", "the top level takes"),
    ("key of 5000 letters", lambda text: "k" * 5000 + " = 1\n" + text, "kkk", "the top level takes"),
    ("key that colours terminals", lambda text: '"\\u001b[31m" = 1\n' + text, "\\x1b[31m", "takes"),
    ("a dotted unknown key", lambda text: "lens.front.colour = 1\n" + text, "line", "mend it there"),
    ("no source half-width", ("source.half_width",), "source.half_width", "must be at least 1e-06"),
]
PARTNERS = [
    ("a function without a formula", FORMULA, "target.formula", "add it"),
    (
        "a point with a profile",
        {"source.kind": "point", "source.profile": "round"},
        "source.profile",
        "has none",
    ),
    ("a luminaire without a file", {"source.kind": "luminaire"}, "source.file", "add it"),
    (
        "a luminaire of a file that is not there",
        {"source.kind": "luminaire", "source.file": "none.ies"},
        "source.file",
        "check the path",
    ),
    (
        "a luminaire with a picture",
        {"source.kind": "luminaire", "source.file": "lamp.ies", "source.profile": "gaussian"},
        "source.profile",
        "uniform",
    ),
    ("rays without a file", {"source.kind": "rays"}, "source.file", "add it"),
    (
        "a ray file of a beam",
        {"source.file": "led.tm25ray"},
        "source.file",
        'set source.kind = "rays" or "luminaire"',
    ),
    (
        "rays of a file that is not there",
        {"source.kind": "rays", "source.file": "none.tm25ray"},
        "source.file",
        "check the path",
    ),
    (
        "rays with a profile",
        {"source.kind": "rays", "source.file": "led.ray", "source.profile": "round"},
        "source.profile",
        "has none",
    ),
    (
        "a lamp that diverges",
        LAMP | {"source.divergence": 1.0},
        "source.divergence",
        'has no effect with source.kind = "lambertian"',
    ),
    (
        "a Gaussian without its width",
        {"source.divergence_profile": "gaussian"},
        "source.divergence_profile",
        "needs source.divergence",
    ),
    (
        "a Gaussian between the rays",
        {"source.profile": "gaussian", "source.sigma": [1e-3, 1.0]},
        "source.sigma",
        "take a smaller source.half_width",
    ),
    ("merged to nothing", {"optimizer.merge": 32}, "optimizer.merge", "must leave at least"),
    ("mass without density", {"limits.mass": 1.0}, "limits.mass", "needs lens.density"),
    ("a limit beyond the lens", {"limits.thickness": 1e300}, "limits.thickness", "must be at most"),
    (
        "surfaces that cross",
        {"lens.thickness": 1.0, "lens.rear.radius": -20.0},
        "lens",
        "raise lens.thickness by more than",
    ),
    ("a conic that ends", {"lens.front.radius": 12.0}, "lens.front", "make its radius larger"),
    ("a target in the lens", {"target.distance": 0.5}, "target.distance", "must be greater than"),
    (
        "a target that no lens lights",
        {"target.half_width": [500.0, 20.0]},
        "target.half_width",
        "make target.half_width smaller or target.distance larger",
    ),
    (
        "a lamp that touches the lens",
        LAMP | {"source.half_width": [5.0, 5.0], "source.distance": 0.1} | BOWL,
        "source.distance",
        "make source.distance larger or source.half_width smaller",
    ),
    ("a lit speck", TOP_HAT | {"target.lit": [1e-9, 1e-9]}, "target.lit", "make it larger"),
    ("rays without end", {REAR + "spans": [500, 500], REAR + "max_level": 9}, "rays at once", "use fewer"),
]
FORMULAS = [
    ("an import", _formula("__import__('os').system('true')"), "target.formula", "it takes numbers"),
    ("an unknown name", _formula("exp(-z^2)"), "target.formula", "it takes numbers"),
    ("an unknown function", _formula("gauss(x)"), "target.formula", "it takes numbers"),
    ("half a formula", _formula("1 + "), "target.formula", "it takes numbers"),
    ("negative light", _formula("x"), "target.formula", "max(0, ...) cuts it off"),
    ("infinite light", _formula("1/0"), "target.formula", "light must be finite"),
    ("no number", _formula("sqrt(-1 - r)"), "target.formula", "look for 0 / 0"),
    ("no light", _formula("0 * x"), "target.formula", "greater than 0 where you want light"),
    ("150 signs", _formula("-" * 150 + "x"), "target.formula", "in a simpler way"),
    ("a formula of 3000 characters", _formula("x+" * 1500 + "1"), "target.formula", "at most 2000"),
    ("too few values", _formula("hypot(x)"), "target.formula", "takes 2 values"),
]
TEXTS = [
    ("an empty file", lambda text: "", "source", "add it"),
    ("comments alone", lambda text: "# " + text.replace("\n", "\n# "), "source", "add it"),
    ("half a line", _replaced("index = 1.5", "index ="), "line", "mend it there"),
    ("a key twice", _replaced("index = 1.5", "index = 1.5\nindex = 1.6"), "line", "mend it there"),
    ("a table twice", lambda text: text + "[source]\n", "line", "mend it there"),
    ("a comma for a point", _replaced("index = 1.5", "index = 1,5"), "line", "mend it there"),
    ("a unit behind a number", _replaced("thickness = 6.0", "thickness = 6.0 mm"), "line", "mend it there"),
    ("JSON", lambda text: '{"title": "lens"}', "line", "mend it there"),
    ("YAML", lambda text: "title: lens\nsource:\n  kind: point\n", "line", "mend it there"),
    ("an open string", _replaced('title = "small"', 'title = "small'), "line", "mend it there"),
    ("a zero byte", lambda text: text + "\0", "line", "mend it there"),
    ("UTF-16, cut off", lambda text: text.encode("utf-16")[:-1], "not UTF-16 text: line", "save it as UTF-8"),
    ("Latin-1", lambda text: ("# für\n" + text).encode("latin-1"), "UTF-8", "save it as UTF-8"),
    (
        "a picture",
        lambda text: b"\x89PNG\r\n\x1a\n" + bytes(2_000_000),
        "is a PNG picture, not a problem file",
        "write it by `thbcad new > my.toml`, then run `thbcad check my.toml --set target.image=",
    ),
    ("a gzip archive", lambda text: b"\x1f\x8b\x08\0" + bytes(99), "is a gzip archive", "give a TOML file"),
    (
        "nesting without end",
        lambda text: "x = " + "[" * 9000 + text,
        "nested more than 16 deep",
        "mend it there",
    ),
    (
        "a key without end",
        lambda text: text + "\na" + ".a" * 100_000 + "=1",
        "a key has more than 16 parts",
        "mend it there",
    ),
    (
        "two megabytes",
        lambda text: text + "#" * 2_000_000,
        "has more than 1,000,000 letters",
        "is it the right file?",
    ),
    (
        "cut in the middle",
        lambda text: text[: text.index("conic") + 3],
        "at end of document",
        "mend it there",
    ),
    ("cut after a table", lambda text: text[: text.index("[lens.front]")], "lens.front", "add it"),
]
AWAY = {"target.distance": False}
SCREENS = [
    ("a place said twice", {"target.position": [0.0, 0.0, 60.0]}, "target.distance", "leave one of them out"),
    ("a target nowhere", AWAY, "target.distance", "or target.position"),
    ("a place as a number", AWAY | {"target.position": 60.0}, "target.position", "a list of 3 numbers"),
    ("a place that is none", AWAY | {"target.position": [0.0, NAN, 9.0]}, "target.position[1]", "finite"),
    ("two tilts", {"target.tilt": [10.0, 20.0]}, "target.tilt", "a list of 3 numbers"),
    ("a tilt of two turns", {"target.tilt": [720.0, 0.0, 0.0]}, "target.tilt[0]", "at most 360"),
    (
        "a far field with a place",
        AWAY | {"target.surface": "far_field", "target.position": [0.0, 0.0, 9.0]},
        "target.position",
        "target.tilt",
    ),
    ("a far field that is near", {"target.surface": "far_field"}, "target.distance = 60", "leave that out"),
    (
        "a cylinder far away",
        {"target.surface": "cylinder", "target.radius": 50.0, "target.distance": INF},
        "target.surface",
        "give the distance",
    ),
    ("a surface of no kind", {"target.surface": "dome"}, "target.surface", "'sphere'"),
    ("a cylinder without radius", {"target.surface": "cylinder"}, "target.radius", "add it"),
    ("a sphere of radius 0", {"target.surface": "sphere", "target.radius": 0.0}, "target.radius", "not be 0"),
    ("a plane with a radius", {"target.radius": 50.0}, "target.radius", "leave it out"),
    (
        "a target round the cylinder",
        {"target.surface": "cylinder", "target.radius": -12.0},
        "target.half_width[0]",
        "less than a quarter turn of the cylinder, 18.8496 mm",
    ),
    (
        "a target over the pole",
        {"target.surface": "sphere", "target.radius": 18.0, "target.half_width": [9.0, 29.0]},
        "target.half_width[1]",
        "quarter turn of the sphere",
    ),
    ("a target turned away", {"target.tilt": [180.0, 0.0, 0.0]}, "100% of the light", "target.tilt"),
    (
        "a ball that hides its sides",
        TOP_HAT | {"target.surface": "sphere", "target.radius": 13.0, "target.lit": [1.0, 1.0]},
        "shows the lens its back",
        "make it smaller",
    ),
    (
        "a target through the lens",
        AWAY | {"target.position": [0.0, 0.0, 3.0], "target.tilt": [0.0, 30.0, 0.0]},
        "target cuts the lens",
        "move target.position away",
    ),
    (
        "a wall along the lens",
        AWAY
        | {
            "target.position": [0.0, -5.0, 40.0],
            "target.tilt": [90.0, 0.0, 0.0],
            "target.half_width": [20.0, 60.0],
        },
        "target cuts the lens",
        "target.tilt",
    ),
    (
        "a target before the lens",
        AWAY | {"target.position": [0.0, 0.0, -60.0]},
        "100% of the light",
        "move target.position or turn target.tilt there",
    ),
    (
        "a far field behind",
        {"target.distance": INF, "target.tilt": [120.0, 0.0, 0.0]},
        "100% of the light",
        "turn target.tilt there",
    ),
    (
        "a target far aside",
        AWAY | {"target.position": [150.0, 0.0, 60.0], "target.tilt": [0.0, 45.0, 0.0]},
        "bends rays by less than 48.2 degrees",
        "move target.position nearer the axis",
    ),
]
BAD_PROBLEMS = [*TYPES, *RANGES, *WORDS, *KEYS, *PARTNERS, *SCREENS, *FORMULAS, *TEXTS]
