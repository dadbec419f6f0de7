"""Pictures of form errors are PNG files."""

from optics.making_figures import allowed_figure


def test_the_allowed_error_is_drawn():
    picture = allowed_figure([(1.0, 2.0), (2.0, 5.0)], [1e-5, 3e-5], [3e-5, 9e-5])
    assert picture.startswith(b"\x89PNG")
