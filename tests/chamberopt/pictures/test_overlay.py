"""Texts over a view."""

from chamberopt.pictures.overlay import wrap


def test_a_title_breaks_before_no_unit() -> None:
    text = "mean 80.1 ± 2.0 %   std 12.4 ± 0.3 %   in windows of 20 mm²"
    for width in range(400, 800, 10):
        lines = wrap(text, float(width), 14).splitlines()
        assert not any(one.startswith(("%", "±", "mm²")) for one in lines), width
