"""Texts of a STEP file written otherwise, and damaged ones: functions of the text (and of a generator)."""

import re

import numpy as np

ENTITY = re.compile(r"#(\d+)\s*=\s*((?:[^';]|'(?:[^']|'')*')*);\s*")
STRING_OR = r"('(?:[^']|'')*')|"
REAL = r"-?\d+\.\d*(?:E-?\d+)?"


def split(text):
    """Return (head, [(number, body)], tail) of a file."""
    start = text.index("DATA;") + 5
    stop = text.index("ENDSEC;", start)
    return text[:start] + "\n", ENTITY.findall(text[start:stop]), text[stop:]


def joined(head, entities, tail):
    return head + "".join(f"#{number}={body};\n" for number, body in entities) + tail


def outside_strings(pattern, replacement, text):
    """Return the text with a pattern replaced wherever it is not part of a string."""
    return re.sub(STRING_OR + pattern, lambda m: m[1] or m.expand(replacement), text)


def renumbered(text, numbers):
    """Return the text with other numbers, those that a function of the old number gives."""
    head, entities, tail = split(text)
    change = re.compile(STRING_OR + r"#(\d+)")

    def new(body):
        return change.sub(lambda m: m[1] or f"#{numbers(int(m[2]))}", body)

    return joined(head, [(numbers(int(number)), new(body)) for number, body in entities], tail)


def shuffled(text, rng):
    head, entities, tail = split(text)
    return joined(head, [entities[k] for k in rng.permutation(len(entities))], tail)


def randomly_renumbered(text, rng):
    most = len(split(text)[1])
    order = rng.permutation(10 * most) + 1
    return renumbered(text, lambda number: order[number])


def data(text, change):
    """Return the text with what stands between DATA; and ENDSEC; changed."""
    head, entities, tail = split(text)
    return head + change("".join(f"#{number}={body};\n" for number, body in entities)) + tail


def long_reals(text):
    """Return the text with every real written with 17 digits and an exponent."""

    def longer(match):
        mantissa, exponent = f"{float(match[2]):+.16E}".split("E")
        return f"{mantissa}E{int(exponent):+d}"

    return data(text, lambda d: re.sub(STRING_OR + rf"(?<![\w.])({REAL})", lambda m: m[1] or longer(m), d))


def listed(text, pattern, change):
    """Return the text with the first list of references behind a pattern changed."""
    found = re.search(pattern + r"\(([^)]*)\)", text)
    return (
        text[: found.start(1)]
        + ",".join(change(found[1].replace("\n", "").split(",")))
        + text[found.end(1) :]
    )


def without_colours(text):
    head, entities, tail = split(text)
    kinds = r"STYLED_ITEM|PRESENTATION_STYLE|SURFACE_S[IT]|FILL_AREA|COLOUR_RGB|MECHANICAL_DESIGN_GEOM"
    return joined(head, [(n, body) for n, body in entities if not re.match(kinds, body)], tail)


def replaced(pattern, replacement, times=1):
    """Return a change that replaces a pattern in the text, which must be there."""

    def change(text, rng=None):
        new, found = re.subn(pattern, replacement, text, count=times)
        assert found
        assert new != text
        return new

    return change


REWRITES = {
    "CRLF": lambda t, r: t.replace("\n", "\r\n"),
    "comments between entities": lambda t, r: t.replace(";\n", "; /* a #1 = comment; */\n"),
    "comments within entities": lambda t, r: data(t, lambda d: outside_strings("=", "=/* it's */", d)),
    "a comment in the header": lambda t, r: t.replace("HEADER;", "HEADER; /* ENDSEC; */"),
    "numbers from 1000": lambda t, r: renumbered(t, lambda n: n + 999),
    "numbers backwards": lambda t, r: renumbered(t, lambda n: 100_000 - n),
    "random numbers": randomly_renumbered,
    "entities backwards": lambda t, r: joined(split(t)[0], split(t)[1][::-1], split(t)[2]),
    "entities shuffled": shuffled,
    "shuffled and renumbered": lambda t, r: shuffled(randomly_renumbered(t, r), r),
    "one entity a line": lambda t, r: data(
        t, lambda d: d.replace(";\n", "\0").replace("\n", "").replace("\0", ";\n")
    ),
    "one line": lambda t, r: t.replace("\n", ""),
    "a line for every parameter": lambda t, r: data(t, lambda d: outside_strings(",", ",\n", d)),
    "blanks": lambda t, r: data(t, lambda d: outside_strings("([=,()])", r" \g<2> ", d)),
    "tabs": lambda t, r: data(t, lambda d: outside_strings("([,(])", "\\g<2>\t", d)),
    "other time stamp": replaced("2000-01-01T00:00:00", "2031-05-06T07:08:09+02:00"),
    "other preprocessor": replaced(r"processor \d.\d','thbcad'", "processor 8.9','another'"),
    "other description": replaced(r"\('Open CASCADE Model'\),'2;1'", "('ViewDefinition [x]','y'),'3;1'"),
    "reals with exponents": lambda t, r: long_reals(t),
    "two newlines at the end": lambda t, r: t + "\n\n",
    "no newline at the end": lambda t, r: t.rstrip(),
    "blank lines at the top": lambda t, r: "\n\n" + t,
    "faces in another order": lambda t, r: listed(t, r"CLOSED_SHELL\('',", lambda k: k[::-1]),
    "a loop from its second edge on": lambda t, r: listed(t, r"EDGE_LOOP\('',", lambda k: k[1:] + k[:1]),
    "no colours": lambda t, r: without_colours(t),
    "the schema as OCCT has it": replaced(r"MIM_LF\b\.?", "MIM_LF."),
    "letters by their codes": replaced(r"'front'", r"'\\X2\\00660072\\X0\\ont'"),
    "an entity that nothing needs": lambda t, r: data(t, lambda d: d + "#999999=DIRECTION('',(1.,0.,0.));\n"),
}


# damage


def carrier(text, name):
    """Return the number of the surface of a face."""
    return re.search(rf"ADVANCED_FACE\('{re.escape(name)}',\(#\d+\),#(\d+),", text)[1]


def net(text, name):
    """Return the match of a face's rows of poles."""
    start = rf"#{carrier(text, name)}=B_SPLINE_SURFACE_WITH_KNOTS\('',\d+,\d+,"
    return re.search(start + r"\((.*?)\)\s*\),\.", text, re.DOTALL)


def poles(text, name):
    """Return the numbers of a face's poles, rows of columns."""
    return np.array([re.findall(r"#(\d+)", row) for row in net(text, name)[1].split("(")[1:]])


def point(text, number):
    """Return the match of a point's coordinates."""
    return re.search(rf"#{number}=CARTESIAN_POINT\(\s*''\s*,\s*\(([^)]*)\)", text)


def placed(text, number, coordinates):
    """Return the text with a point elsewhere."""
    found = point(text, number)
    numbers = ",".join(c if isinstance(c, str) else f"{c:#.17G}" for c in coordinates)
    return text[: found.start(1)] + numbers + text[found.end(1) :]


def at(text, number):
    return np.array([float(c) for c in point(text, number)[1].split(",")])


def moved(text, number, change):
    return placed(text, number, at(text, number) + change)


def pole_moved(name, i, j, change):
    return lambda text: moved(text, poles(text, name)[i, j], change)


def last_bit(text):
    number = poles(text, "rear")[3, 3]
    x, y, z = at(text, number)
    return placed(text, number, (x, y, np.nextafter(z, 9)))


def swapped(*pair):
    """Two poles of the rear change places."""

    def change(text):
        first, second = (poles(text, "rear")[k] for k in pair)
        there, here = at(text, first), at(text, second)
        return placed(placed(text, first, here), second, there)

    return change


def pole_written(*last):
    return lambda text: placed(
        text, (number := poles(text, "rear")[3, 3]), [*at(text, number)[: 3 - len(last)], *last]
    )


def pushed_through(text):
    """The inner poles of the rear lie before the front; its rims stay."""
    for number in poles(text, "rear")[1:-1, 1:-1].ravel():
        text = moved(text, number, [0, 0, -30.0])
    return text


def turned_net(text):
    """The poles of the rear are given in columns of rows."""
    pair = net(text, "rear")
    rows = ",".join("(" + ",".join(f"#{k}" for k in row) + ")" for row in poles(text, "rear").T)
    return text[: pair.start(1)] + rows[:-1] + text[pair.end(1) :]


def knot_moved(text):
    """The second knot of the rear in x."""
    found = re.search(
        rf"#{carrier(text, 'rear')}=B_SPLINE_SURFACE_WITH_KNOTS.*?\),\(\s*(?:{REAL}),\s*({REAL})", text, re.S
    )
    return text[: found.start(1)] + f"{float(found[1]) + 1e-3:#.17G}" + text[found.end(1) :]


def flat_points(text):
    """Return the numbers of the points in the parameters of faces."""
    return re.findall(r"#(\d+)=CARTESIAN_POINT\('',\([^,)]*,[^,)]*\)\)", text)


def image_moved(text):
    """The third pole of the first image that is a spline: 3 mm."""
    points = set(flat_points(text))
    curves = re.findall(r"B_SPLINE_CURVE_WITH_KNOTS\('',\d+,\(([^)]*)\)", text)
    images = [numbers for c in curves if (numbers := re.findall(r"\d+", c))[0] in points]
    return moved(text, images[0][2], [3.0, 0.0])


def image_line_moved(text):
    return moved(text, re.search(r"=LINE\('',#(\d+),", text)[1], [0.0, 0.001])


def rim_moved(change):
    """An inner pole of the first edge's spline."""

    def change_text(text):
        first = re.search(r"B_SPLINE_CURVE_WITH_KNOTS\('',\d+,\(([^)]*)\)", text)[1]
        return moved(text, re.findall(r"\d+", first)[2], change)

    return change_text


def corner_moved(text):
    return moved(text, re.findall(r"VERTEX_POINT\('',#(\d+)\)", text)[5], [0, 0, 1e-3])


def plane_moved(change):
    def change_text(text):
        place = re.search(r"=PLANE\('',#(\d+)\)", text)[1]
        return moved(text, re.search(rf"#{place}=AXIS2_PLACEMENT_3D\('',#(\d+)", text)[1], change)

    return change_text


def names_exchanged(text):
    other = {"front": "rear", "rear": "front"}
    return re.sub(r"(FACE\(')(front|rear)", lambda m: m[1] + other[m[2]], text)


def entity_lost(text):
    return re.sub(rf"#{poles(text, 'rear')[2, 2]}=[^;]*;\s*", "", text)


def other_image_surface(text):
    """The first image of an edge is said to lie on the rear."""
    return re.sub(r"PCURVE\('',#\d+,", f"PCURVE('',#{carrier(text, 'rear')},", text, count=1)


def two_solids(text):
    return data(text, lambda d: d + "#999999=MANIFOLD_SOLID_BREP('',#16);\n")


# what is done to the file, and whether the file's text shows it without the lens
CORRUPTIONS = {
    "a rear pole a nanometre higher": (pole_moved("rear", 3, 3, [0, 0, 1e-6]), False),
    "a rear pole's last bit": (last_bit, False),
    "a rear pole a nanometre aside": (pole_moved("rear", 3, 3, [1e-6, 0, 0]), True),
    "a front pole a nanometre aside": (pole_moved("front", 1, 2, [0, 1e-6, 0]), True),
    "a front pole a nanometre higher": (pole_moved("front", 1, 2, [0, 0, 1e-6]), False),
    "a pole at z = 1e300": (pole_written("1.E300"), True),
    "a pole at z = 1e8": (pole_written("1.E8"), False),
    "a pole beyond float64": (pole_written("1.E999"), True),
    "a coordinate without a point": (pole_written("3"), True),
    "a point in the plane": (pole_written("1.,2."), True),
    "a middle pole 500 mm aside": (pole_moved("rear", 4, 4, [500.0, 0, 0]), True),
    "a middle pole 500 mm before": (pole_moved("rear", 4, 4, [0, 0, -500.0]), True),
    "poles far apart exchanged": (swapped((1, 1), (7, 8)), True),
    "neighbouring poles exchanged": (swapped((3, 3), (3, 4)), True),
    "the rear pushed through the front": (pushed_through, True),
    "rows and columns exchanged": (turned_net, True),
    "a knot moved": (knot_moved, True),
    "another degree": (replaced(r"(SURFACE_WITH_KNOTS\('',)3,3", r"\g<1>2,3"), True),
    "a pole of an image 3 mm aside": (image_moved, True),
    "an image a micrometre aside": (image_line_moved, True),
    "an image on another surface": (other_image_surface, True),
    "an image left out": (replaced(r"(SURFACE_CURVE\('',#\d+,\(#\d+),#\d+", r"\g<1>"), False),
    "a rim a micrometre off": (rim_moved([0, 0, 1e-3]), True),
    "a rim a picometre off": (rim_moved([0, 0, 1e-9]), False),
    "a corner a micrometre off": (corner_moved, True),
    "a plane a hundredth aside": (plane_moved([0.01, 0.01, 0.0]), True),
    "a plane a nanometre aside": (plane_moved([1e-7, 1e-7, 0.0]), False),
    "an edge turned round": (replaced(r"(EDGE_CURVE\('',#\d+,#\d+,#\d+,)\.T\.", r"\g<1>.F."), True),
    "an edge in a loop turned round": (replaced(r"(ORIENTED_EDGE\('',\*,\*,#\d+,)\.T\.", r"\g<1>.F."), True),
    "a loop turned round": (replaced(r"(FACE_BOUND\('',#\d+,)\.F\.", r"\g<1>.T."), True),
    "a face turned round": (replaced(r"(ADVANCED_FACE\('rear',\(#\d+\),#\d+,)\.T\.", r"\g<1>.F."), True),
    "edges in another order": (replaced(r"(EDGE_LOOP\('',\()(#\d+),(#\d+)", r"\g<1>\g<3>,\g<2>"), True),
    "a face missing": (lambda t: listed(t, r"CLOSED_SHELL\('',", lambda k: k[:-1]), True),
    "a face twice": (lambda t: listed(t, r"CLOSED_SHELL\('',", lambda k: [*k[:-1], k[0]]), True),
    "centimetres": (replaced(r"SI_UNIT\(\.MILLI\.", "SI_UNIT(.CENTI."), True),
    "metres": (replaced(r"SI_UNIT\(\.MILLI\.", "SI_UNIT($"), True),
    "a schema of nonsense": (replaced(r"'AP242_[^']*'", "'NONSENSE'"), True),
    "two faces named front": (replaced("FACE\\('rear'", "FACE('front'"), True),
    "the names of front and rear exchanged": (names_exchanged, True),
    "a face without its name": (replaced("FACE\\('edge -y'", "FACE(''"), False),
    "an open face that says it is closed": (
        replaced(r"(SURFACE_WITH_KNOTS[^.]*?\.UNSPECIFIED\.,\s*)\.F\.", r"\g<1>.T."),
        True,
    ),
    "an open curve that says it is closed": (
        replaced(r"(CURVE_WITH_KNOTS[^.]*?\.UNSPECIFIED\.,\s*)\.F\.", r"\g<1>.T."),
        True,
    ),
    "another product": (replaced(r"=PRODUCT\('[^']*'", "=PRODUCT('other'"), False),
    "another material": (replaced("refractive index 1.5", "refractive index 1.7"), False),
    "another author": (replaced(r"(FILE_NAME\('[^']*','[^']*',\(\s*')", r"\g<1>other"), False),
    "another uncertainty": (replaced(r"LENGTH_MEASURE\(\s*[^)]*\)", "LENGTH_MEASURE(1.E-2)"), False),
    "half of the file": (lambda t: t[: len(t) // 2], True),
    "the end cut off": (lambda t: t[: t.rindex("END-ISO")], True),
    "an entity lost": (entity_lost, True),
    "a number twice": (replaced(r"#23=", "#22="), True),
    "two solids": (two_solids, True),
    "a placement": (
        lambda t: data(t, lambda d: d + "#999999=ITEM_DEFINED_TRANSFORMATION('','',#11,#11);\n"),
        True,
    ),
    "bytes of another file": (lambda t: t[: len(t) // 3] + "\0\1\2;'" + t[len(t) // 3 + 5 :], True),
}
