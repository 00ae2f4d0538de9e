"""The first page of a report, and what a person puts on it."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import io
import re
from pathlib import Path

import pytest
from PIL import Image

from sarl_core import Demonstrations, InputError, WorkError, load_demonstrations, mine_rules
from sarl_core.explaining.report.comparison import read_results
from sarl_core.explaining.report.cover import Cover, logo_of, read_logo
from sarl_core.explaining.report.report import Report, make_report
from sarl_core.explaining.report.summary import pairs_of

ROOT = Path(__file__).parents[2]
CSV = ROOT / "docs" / "reports" / "cartpole.csv"
HOSTILE = "<script>alert(1)</script>{{ 7*7 }}"


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    return load_demonstrations(ROOT / "data" / "demonstrations" / "cartpole.parquet")


def reported(cart: Demonstrations, **wishes: object) -> Report:
    return make_report(mine_rules(cart, supp_min=0.005, conf_min=0.95), cart, frames=0, **wishes)


def first_page(report: Report) -> str:
    return report.html.split("<header")[1].split("</header>")[0]


def picture(form: str) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (900, 300), "#336699").save(file, format=form)
    return file.getvalue()


def test_the_first_page_says_what_the_rules_do_to_whom(cart: Demonstrations) -> None:
    results = read_results(CSV)
    page = first_page(reported(cart, comparison=results))
    for pair in pairs_of(results):
        assert pair.alone is not None
        assert pair.alone.agent == pair.shielded.agent
        assert f"With the rules (“{pair.shielded.name}”) the mean return of the" in page
    assert "95 % intervals" in page
    assert page.count("<svg") == 2 * len(results)
    assert "What to decide" in page


def test_intervals_are_announced_only_where_there_are_some(cart: Demonstrations) -> None:
    _, shielded, *_ = read_results(CSV)
    bare = dataclasses.replace(
        shielded, episodes=1, gained=None, crashes=None, crash_ends=None, effect=""
    )
    page = first_page(reported(cart, comparison=[bare]))
    assert "rests on 1 episode of an agent. Of what the rules change there is no interval" in page
    assert "Its 95 % intervals:" not in page


def test_without_a_comparison_the_first_page_says_how_to_get_one(cart: Demonstrations) -> None:
    page = first_page(reported(cart))
    assert "Nothing was measured for this report" in page
    assert "sarl evaluate --env CartPole-v1" in page
    assert "--comparison" in page
    assert "sarl audit" in first_page(reported(dataclasses.replace(cart, env_id="")))


def test_the_first_page_says_what_the_card_of_the_rules_reports(cart: Demonstrations) -> None:
    card = {"reported": {"episodes": 1000, "mean": 251.29, "failures": 23}}
    page = first_page(reported(cart, card=card))
    assert "an agent that follows them had a mean return of 251 over 1,000 episodes." in page
    assert "Nothing was measured for this report" in page
    card["reported"] |= {"failure_low": 0.0146, "failure_high": 0.0343}
    assert "failures: 23 of 1,000" in first_page(reported(cart, card=card))
    assert "had a mean return" not in first_page(reported(cart))


def test_only_what_is_of_one_agent_on_the_same_seeds_stands_side_by_side() -> None:
    alone, shielded, *_ = read_results(CSV)
    assert pairs_of([alone, shielded])[0].alone == alone
    other = dataclasses.replace(alone, agent="somebody else")
    later = dataclasses.replace(alone, seed=7)
    for one in (other, later):
        assert pairs_of([one, shielded])[0].alone is None
    nameless = [dataclasses.replace(one, agent="") for one in (alone, shielded)]
    assert pairs_of(nameless)[0].alone == nameless[0]
    assert pairs_of([*nameless, dataclasses.replace(nameless[0], mean=0.0)])[0].alone is None


def test_what_a_person_sets_stands_on_the_first_page_as_text(cart: Demonstrations) -> None:
    cover = Cover(
        title=f"Title {HOSTILE}",
        author=f"Author {HOSTILE}",
        date="28 November 2026",
        notes=f"One.\nNote {HOSTILE}",
        signers=(f"Signer {HOSTILE}",),
        logo=logo_of(picture("JPEG"), "logo.jpg"),
    )
    page = first_page(reported(cart, cover=cover))
    assert "<script" not in page
    for word in ("Title", "Author", "Note", "Signer"):
        assert f"{word} &lt;script&gt;alert(1)&lt;/script&gt;{{{{ 7*7 }}}}" in page
    assert "28 November 2026" in page
    assert 'src="data:image/png;base64,' in page


def test_a_title_of_blanks_is_none(cart: Demonstrations) -> None:
    assert "<h1>Rules for" in first_page(reported(cart, cover=Cover(title="  ")))


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"title": "x" * 10_000}, "the title of a report has 10,000 characters"),
        ({"notes": "x" * 401}, "the notes of a report have"),
        ({"signers": ("a",) * 5}, "5 people are to sign"),
        ({"notes": "a\n" * 9}, "the notes of a report have 9 lines; give at most 8"),
        ({"author": 3}, "must be text"),
        ({"title": "a\udcffb"}, "is none in UTF-8"),
    ],
)
def test_what_does_not_fit_on_a_page_is_refused(settings: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Cover(**settings)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>",
        picture("GIF"),
        picture("PNG")[:200],
    ],
    ids=["nothing", "script", "another format", "half"],
)
def test_a_logo_that_is_no_picture_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "logo.png"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is no PNG or JPEG picture") as caught:
        read_logo(path)
    assert "\n" not in str(caught.value)


def test_a_logo_is_drawn_anew_and_small() -> None:
    hidden = b"<script>alert(1)</script>"
    logo = logo_of(picture("PNG") + hidden, "logo.png")
    assert logo == logo_of(picture("PNG"), "logo.png")
    assert logo.height <= 160


def test_slides_hold_one_rule_each_and_run_no_script_but_their_own(
    cart: Demonstrations, tmp_path: Path
) -> None:
    report = reported(cart, cover=Cover(title=HOSTILE), in_full=3)
    path = tmp_path / "slides.html"
    report.save_slides(path)
    html = path.read_text(encoding="utf-8")
    assert html.count('<section class="slide"') == html.count("<article") + 2 == 5
    (code,) = re.findall(r"<script>(.*?)</script>", html, flags=re.S)
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in html
    with pytest.raises(InputError, match=r"end in \.html"):
        report.save_slides(tmp_path / "slides.pdf")


def test_a_report_is_printed(cart: Demonstrations, tmp_path: Path) -> None:
    path = tmp_path / "report.pdf"
    signers = ("Ada", "Grace", "Mary", "Emmy")
    cover = Cover(title="x" * 120, author="Ada", notes="word " * 80, signers=signers)
    reported(cart, comparison=read_results(CSV), cover=cover).save(path)
    assert path.read_bytes().startswith(b"%PDF")


def test_without_a_browser_a_pdf_is_refused_and_nothing_is_written(
    cart: Demonstrations, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BROWSER_PATH", "/nowhere/chromium")
    report = reported(cart)
    with pytest.raises(WorkError, match="the PDF could not be printed") as caught:
        report.save(tmp_path / "report.pdf")
    assert "write .html" in str(caught.value)
    assert list(tmp_path.iterdir()) == []
