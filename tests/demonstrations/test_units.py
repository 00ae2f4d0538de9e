"""Units behind the names of columns."""

from __future__ import annotations

from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.demonstrations.formats.units import without_units


def test_a_unit_behind_a_name_is_the_unit_of_the_feature(tmp_path):
    file = tmp_path / "lift.csv"
    rows = "".join(f"0,{i % 7},{i % 5}.5,{i % 3},{i % 2}\n" for i in range(20))
    file.write_text(f"episode,load (t),wind [m/s],door (left),action\n{rows}")
    features = load_demonstrations(file).features
    assert [(feature.name, feature.unit) for feature in features] == [
        ("load", "t"),
        ("wind", "m/s"),
        ("door (left)", ""),
    ]


def test_units_are_written_in_many_ways_and_other_brackets_are_not_units():
    names = ("a (m/s^2)", "b [°C]", "c (N·m)", "d (kg m²)", "e (l/100 km)", "f (1)", "g (gear)")
    assert without_units(names) == (
        ("a", "b", "c", "d", "e", "f (1)", "g (gear)"),
        ("m/s^2", "°C", "N·m", "kg m²", "l/100 km", "", ""),
    )


def test_a_unit_that_alone_tells_two_columns_apart_stays_in_the_names():
    assert without_units(("v (m/s)", "v (km/h)")) == (("v (m/s)", "v (km/h)"), ("", ""))
