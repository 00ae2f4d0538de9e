"""What stands before the rows of a CSV file, and columns that hold times."""

from __future__ import annotations

import datetime as dt
import io

import numpy as np
import pandas as pd
import pytest

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import preview_columns, read_demonstrations, table_columns
from sarl_core.errors import InputError

ROWS = ["0.5,8,0,0", "0.25,7,1,0", "0.1,7,1,1", "0.7,6,0,1"]
NAMES = "speed,gap,action,episode"


def read(*lines: str) -> Demonstrations:
    return read_demonstrations("\n".join(lines).encode(), "rig.csv")


@pytest.mark.parametrize(
    "before",
    [
        ("# rig 4, recorded 2026-01-01",),
        ("# rig 4", "# a,b,c,d,e,f", ""),
        ("% from a script", "% of Matlab"),
        ("// one", "", "// two"),
        ('"# quoted, by a spreadsheet"',),
        ("sep=,",),
        ("sep=,", "# rig 4"),
    ],
)
def test_what_stands_before_the_header_is_no_header(before: tuple[str, ...]):
    read_so = read(*before, NAMES, *ROWS)
    assert read_so.feature_names == ("speed", "gap")
    assert read_so.episodes.tolist() == [0, 0, 1, 1]
    with pytest.raises(InputError, match=rf"row 2 \(line {len(before) + 3}\)"):
        read(*before, NAMES, ROWS[0], "0.25,7,1", *ROWS[2:])


def test_a_comment_is_the_header_where_no_other_line_is():
    assert read(f"# {NAMES}", *ROWS).feature_names == ("speed", "gap")
    assert read("# rig 4", f"#{NAMES}", *ROWS).feature_names == ("speed", "gap")
    in_words = [row.replace(",0,", ",hold,").replace(",1,", ",go,") for row in ROWS]
    assert read(f"# {NAMES}", *in_words).feature_names == ("speed", "gap")


@pytest.mark.parametrize("sign", [";", "|", "\t"])
def test_excel_says_what_separates_fields(sign: str):
    lines = [line.replace(",", sign) for line in (NAMES, *ROWS)]
    assert (
        read(f"sep={sign}", *lines).observations.tolist()
        == read(NAMES, *ROWS).observations.tolist()
    )
    assert read(*lines).feature_names == ("speed", "gap")
    with pytest.raises(InputError, match="says that ':' separates fields"):
        read("sep=:", *lines)


def test_decimal_commas_beside_what_excel_says():
    lines = [row.replace(",", ";").replace(".", ",") for row in ROWS]
    read_so = read("sep=;", NAMES.replace(",", ";"), *lines)
    assert read_so.observations[0].tolist() == [0.5, 8]


def test_a_row_of_units_is_kept_as_units():
    read_so = read(NAMES, "m/s,[m],-,-", *ROWS)
    assert read_so.feature_units == ("m/s", "m")
    assert len(read_so) == 4
    with_words = [row.replace(",0,", ",hold,").replace(",1,", ",go,") for row in ROWS]
    assert read("# rig", NAMES, "m/s,m,,", *with_words).feature_units == ("m/s", "m")
    assert read(NAMES, "float,int,int,int", *ROWS).feature_units == ("", "")
    (speed, *_) = preview_columns(
        f"{NAMES}\nm/s,m,-,-\n".encode() + "\n".join(ROWS).encode(), "a.csv"
    )
    assert speed.role is not None
    assert speed.role.unit == "m/s"


def test_a_first_row_of_words_is_a_row():
    names = "valve,shift,action"
    read_so = read(names, "open,day,hold", "closed,night,vent", "open,night,hold")
    assert len(read_so) == 3
    with pytest.raises(InputError, match="'speed'"):
        read(NAMES, "NA,8,0,0", *ROWS)


def test_columns_without_a_name_at_the_end_are_nothing():
    read_so = read(f",{NAMES},,", *(f"{n},{row},," for n, row in enumerate(ROWS)))
    assert read_so.feature_names == ("speed", "gap")


STARTS = [dt.datetime(2026, 3, 1, 8 + run, 0) for run in (0, 0, 1, 1)]
TIMES = [dt.datetime(2026, 3, 1, 8 + run, 0, row) for row, run in enumerate((0, 0, 1, 1))]
FRAME = pd.DataFrame(
    {
        "when": TIMES,
        "t": TIMES,
        "speed": [0.5, 0.2, 0.1, 0.7],
        "action": [0, 1, 1, 0],
        "episode": STARTS,
    }
)


@pytest.mark.parametrize("extension", ["csv", "parquet", "feather", "xlsx"])
def test_times_are_no_features_and_may_number_the_episodes(extension: str):
    out = io.BytesIO()
    write = {"csv": "to_csv", "parquet": "to_parquet", "feather": "to_feather", "xlsx": "to_excel"}
    options = {} if extension in ("feather", "parquet") else {"index": False}
    getattr(FRAME, write[extension])(out, **options)
    read_so = read_demonstrations(out.getvalue(), f"rig.{extension}")
    assert read_so.feature_names == ("speed",)
    assert read_so.episodes.tolist() == [0, 0, 1, 1]
    assert {use.column: use.why for use in read_so.columns}["when"] == "it is a time"


@pytest.mark.parametrize(
    "texts",
    [
        ["01.03.2026 08:00", "01.03.2026 08:01"],
        ["3/1/2026 8:00:00 AM", "3/1/2026 8:00:01 AM"],
        ["20260301T080000", "20260301T080001"],
        ["08:00:00,5", "08:00:01,0"],
        ["2026-03-01T08:00:00Z", "2026-03-01T08:00:01+01:00"],
    ],
)
def test_times_as_people_write_them_are_no_features(texts: list[str]):
    frame = FRAME.assign(when=texts * 2, episode=[0, 0, 1, 1]).drop(columns="t")
    read_so = read_demonstrations(frame.to_csv(index=False).encode(), "rig.csv")
    assert read_so.feature_names == ("speed",)


def test_seconds_since_1970_are_no_feature_however_they_rise():
    random = np.random.default_rng(1)
    stamp = 1.77e9 + np.cumsum(random.uniform(0.1, 2, 30))
    frame = pd.DataFrame({"stamp": stamp, "x": random.random(30), "action": np.arange(30) % 2})
    for scaled in (1, 1e3, 1e9):
        content = frame.assign(stamp=stamp * scaled).to_csv(index=False).encode()
        assert read_demonstrations(content, "rig.csv").feature_names == ("x",)


@pytest.mark.parametrize("sign", ["#", "%", "//"])
def test_a_comment_further_down_is_none_of_the_rows(sign: str) -> None:
    rows = f"1,2,0\n3,4,1\n  {sign} the operator changed\n5,6,0\n{sign} a, b, c\n7,8,1\n"
    read = read_demonstrations(f"{sign} rig 7\nx,y,action\n{rows}".encode(), "rig.csv")
    assert read.observations[:, 0].tolist() == [1, 3, 5, 7]
    wrong = rows.replace("6", "six")
    with pytest.raises(InputError, match=r"holds 'six' in row 3 \(line 6\)"):
        read_demonstrations(f"{sign} rig 7\nx,y,action\n{wrong}".encode(), "rig.csv")
    with pytest.raises(InputError, match="row 3"):  # no head says that these are comments
        read_demonstrations(f"x,y,action\n{rows}".encode(), "rig.csv")
    with pytest.raises(InputError, match="row 3"):
        preview_columns(f"x,y,action\n{rows}".encode(), "rig.csv")


@pytest.mark.parametrize(
    "above",
    [
        ("Crane 4, March 2026", ""),
        ('"Crane 4, March 2026",,,', ",,,"),
        ("Crane 4", "operator,Ann", "serial,4711"),
    ],
)
def test_a_title_above_the_header_is_no_header(above: tuple[str, ...]):
    titled = read(*above, NAMES, *ROWS)
    assert titled.observations.tolist() == read(NAMES, *ROWS).observations.tolist()
    assert any("lines above the header" in note and "Crane 4" in note for note in titled.notes)
    with pytest.raises(InputError, match=rf"row 2 \(line {len(above) + 3}\)"):
        read(*above, NAMES, ROWS[0], "0.25,7,1", *ROWS[2:])


def test_a_first_row_with_few_fields_is_no_title():
    with pytest.raises(InputError, match="no header"):
        read("1,,,,,", *["1,2,3,4,5,6"] * 3)
    assert not any("above" in note for note in read(NAMES, *ROWS).notes)


@pytest.mark.parametrize(
    ("header", "row"), [(",", ","), (",,", ",,"), ("", ","), (",", ""), (",", ",7")]
)
def test_a_delimiter_at_the_end_makes_no_column(header: str, row: str) -> None:
    ended = read(f"{NAMES}{header}", *(f"{one}{row}" for one in ROWS))
    plain = read(NAMES, *ROWS)
    assert ended.observations.tolist() == plain.observations.tolist()
    assert ended.actions.tolist() == plain.actions.tolist()
    assert all(use.why == "it has no name" for use in ended.columns[len(plain.columns) :])


def test_an_unnamed_first_column_numbers_the_rows() -> None:
    numbered = read(f",{NAMES}", *(f"{index},{one}" for index, one in enumerate(ROWS)))
    assert numbered.columns[0].why == "it numbers the rows"


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("sign", [",", ";", "\t", "|"])
@pytest.mark.parametrize("above", ["", "# rig 4\n", '"Crane 4\nMarch 2026"\n\n'])
def test_a_name_may_break_between_its_quotation_marks(newline: str, sign: str, above: str) -> None:
    names = ['"speed\n(m/s)"', '"gap, ""front""\n\n[m]\n"', '"action\n(0/1)"', '"episode\nno"']
    rows = [row.replace(",", sign) for row in ROWS]

    def file(rows: list[str]) -> bytes:
        return (above + "\n".join([sign.join(names), *rows])).replace("\n", newline).encode()

    broken = read_demonstrations(file(rows), "rig.csv")
    plain = read(NAMES, *ROWS)
    columns = ("speed (m/s)", 'gap, "front" [m]', "action (0/1)", "episode no")
    assert table_columns(file(rows), "rig.csv") == columns
    assert broken.observations.tolist() == plain.observations.tolist()
    assert broken.actions.tolist() == plain.actions.tolist()
    assert broken.episodes.tolist() == plain.episodes.tolist()
    assert any("above" in note for note in broken.notes) == above.startswith('"')
    line = len((above + sign.join(names)).split("\n")) + 2
    with pytest.raises(InputError, match=rf"row 2 \(line {line}\) has 3 fields"):
        read_demonstrations(file([rows[0], rows[1][:-2], *rows[2:]]), "rig.csv")


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        ('size 5",gap 6",action,episode', ('size 5"', 'gap 6"', "action", "episode")),
        ('"speed",gap,action,"episode', ("speed", "gap", "action", "episode")),
    ],
)
def test_quotation_marks_around_no_field_hold_no_line_break(
    names: str, columns: tuple[str, ...]
) -> None:
    rows = [f'{row[:-1]}"{row[-1]}"' for row in ROWS]
    content = "\n".join([names, *rows]).encode()
    assert table_columns(content, "rig.csv") == columns
    assert len(read_demonstrations(content, "rig.csv")) == len(ROWS)


@pytest.mark.parametrize(
    ("sign", "names"),
    [
        (",", ("|v|", "x", "action")),
        (",", ("gap; front", "x", "action")),
        (",", ("gap\tfront", "x;y|z", "action")),
        ("\t", ("gap; front", "x, y", "action")),
        ("|", ("gap; front", "x\ty", "action")),
        (";", ("gap | front", "x, y", "action")),
    ],
)
@pytest.mark.parametrize("count", [2, 30])
@pytest.mark.parametrize("above", [(), ("# a; b; c|d",), ('"Crane 4; March, 2026"',)])
def test_a_sign_in_a_name_separates_no_fields(
    sign: str, names: tuple[str, ...], count: int, above: tuple[str, ...]
) -> None:
    rows = [f"{row % 7 / 4}{sign}{row % 5}{sign}{row % 2}" for row in range(count)]
    plain = read_demonstrations(
        "\n".join(["v,x,action", *rows]).replace(sign, ",").encode(), "rig.csv"
    )
    for end in ("", sign):
        content = "\n".join([*above, sign.join(names) + end, *rows]).encode()
        assert table_columns(content, "rig.csv")[:3] == names
        named = read_demonstrations(content, "rig.csv")
        assert named.observations.tolist() == plain.observations.tolist()


def test_decimal_commas_separate_no_fields() -> None:
    rows = [f"{row},5;{row % 3},25;{row % 2}" for row in (3, 1, 4, 1, 5)]
    for names in ("speed;gap;action", "speed, own, m;gap;action"):
        for damaged in ([], ["1,5;2,5"]):
            content = "\n".join([names, *rows, *damaged]).encode()
            assert table_columns(content, "rig.csv") == tuple(names.split(";"))
        read_so = read(names, *rows)
        assert read_so.observations[0].tolist() == [3.5, 0.25]
    assert table_columns("\n".join(rows).encode(), "rig.csv") == (
        "column 1",
        "column 2",
        "column 3",
    )
