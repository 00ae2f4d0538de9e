"""The first page of a report, and what a person puts on it."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sarl_core import Demonstrations, InputError, WorkError, load_demonstrations, mine_rules
from sarl_core.explaining.report import pdf
from sarl_core.explaining.report.comparison import Result, read_results
from sarl_core.explaining.report.cover import Cover, logo_of, read_logo
from sarl_core.explaining.report.outcomes import certainty, pairs_of
from sarl_core.explaining.report.pdf import document_to_pdf
from sarl_core.explaining.report.report import Report, make_report
from sarl_core.explaining.report.rule_set_card import ReportedEpisodes
from sarl_core.explaining.report.slides import BESIDE_RULES
from sarl_core.progress import CancelledError

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
        assert f"Is the {pair.shielded.agent} to act under the rules" in page
    assert "95 %\N{NO-BREAK SPACE}intervals" not in page
    assert "95\N{NO-BREAK SPACE}% intervals" in page
    assert page.count("<svg") == 2 * len(results)
    assert "It fails if the pole falls or the cart leaves its track." in page


def test_intervals_are_announced_only_where_there_are_some(cart: Demonstrations) -> None:
    _, shielded, *_ = read_results(CSV)
    bare = dataclasses.replace(
        shielded, episodes=1, gained=None, crashes=None, crash_ends=None, effect=""
    )
    page = first_page(reported(cart, comparison=[bare]))
    assert "rests on 1 episode. Of what the rules change there is no interval" in page
    assert page.count("% intervals") == 1  # where the picture is explained


def test_without_a_comparison_the_first_page_says_how_to_get_one(cart: Demonstrations) -> None:
    report = reported(cart)
    page = first_page(report)
    assert "Nothing was measured for this report" in page
    assert "Section 5 says how to measure it." in page
    assert "sarl" not in page
    assert "sarl evaluate --env CartPole-v1" in report.html.split('id="worth"')[1]
    assert "sarl audit" in reported(dataclasses.replace(cart, env_id="")).html
    measured = reported(cart, comparison=read_results(CSV)).html
    assert "sarl evaluate" not in measured
    assert "sarl certify" in measured


def test_rules_that_decide_every_step_are_no_shield_and_shown_once(cart: Demonstrations) -> None:
    alone, shielded, expert, other = read_results(CSV)
    ruled = dataclasses.replace(shielded, freedom=0.0, crash_ends=(0.0, 0.03))
    under = dataclasses.replace(ruled, agent=other.agent, name=other.name, effect="harms")
    worse = dataclasses.replace(under, mean=ruled.mean - 1)
    page = first_page(reported(cart, comparison=[alone, ruled, expert, under]))
    assert page.count("<svg") == 2 * 3
    assert "the rules, whoever acts" in page
    assert "the novice alone" in page
    assert "the expert alone" in page
    assert "The rules do better than the novice and worse than the expert." in page
    assert "Are the rules to act in place of the expert?" in page
    assert "shield that corrects it" in page  # some demonstrated states have no rule
    apart = first_page(reported(cart, comparison=[alone, ruled, expert, worse]))
    assert apart.count("<svg") == 2 * 4


def test_what_is_borne_is_asked_of_each_who_is_to_act(cart: Demonstrations) -> None:
    alone, novice, expert, shielded = read_results(CSV)
    calm = dataclasses.replace(shielded, episodes=200, crashes=0.0, crash_ends=(0.0, 0.018))
    again = dataclasses.replace(novice, name="a second test", crash_ends=(0.8, 0.92))
    reports = {"mean": 480.0, "episodes": 3000, "failures": 90}
    card = {"reported": reports | {"failure_low": 0.024, "failure_high": 0.037}}

    def borne(*results: Result) -> list[str]:
        page = first_page(reported(cart, comparison=results, card=card))
        rows = page.replace("\N{NO-BREAK SPACE}", " ").split("<strong>")
        return [row.split("</th>")[0] for row in rows if row.startswith("Can it be borne")]

    first, second = borne(alone, novice, expert, calm, again)
    assert "up to 92 % of the episodes fail when the novice acts under the rules?" in first
    assert "of 100 episodes (“a second test”), the worst of 2 tests." in first
    assert "up to 1.8 % of the episodes fail when the expert acts under the rules?" in second
    assert "of 200 episodes (“expert, filtered”). No limit is certified of it." in second
    (ruled,) = borne(*(dataclasses.replace(one, freedom=0.0) for one in (calm, shielded)))
    assert "up to 64 % of the episodes fail when the rules act?" in ruled
    assert "the worst of 3 tests" in ruled
    (unmeasured,) = borne()
    assert "up to 3.7 % of the episodes fail when an agent follows the rules?" in unmeasured
    assert "of 3,000 episodes (on the card of the rules)." in unmeasured


def test_features_that_no_rule_asks_about_are_named(cart: Demonstrations) -> None:
    names = cart.feature_names
    idle = dataclasses.replace(
        cart, observations=np.where(np.arange(4) == 1, np.float32(0), cart.observations)
    )
    page = first_page(make_report(mine_rules(idle, supp_min=0.005, conf_min=0.95), idle, frames=0))
    assert f"No rule looks at “{names[1]}”" in page
    assert "No rule looks at" not in first_page(reported(cart))


def test_what_was_compared_has_a_fingerprint(cart: Demonstrations) -> None:
    digest = hashlib.sha256(CSV.read_bytes()).hexdigest()
    assert f"{digest} ({CSV.name})" in reported(cart, comparison=read_results(CSV)).html


def test_the_first_page_says_what_the_card_of_the_rules_reports(cart: Demonstrations) -> None:
    card = {"reported": {"episodes": 1000, "mean": 251.29, "failures": 23}}
    page = first_page(reported(cart, card=card))
    assert "an agent that follows them had a mean return of 251 over 1,000 episodes." in page
    assert "Nothing was measured for this report" in page
    card["reported"] |= {"failure_low": 0.0146, "failure_high": 0.0343}
    assert "failures: 23 of 1,000" in first_page(reported(cart, card=card))
    assert "had a mean return" not in first_page(reported(cart))


@pytest.mark.parametrize(
    "wrong",
    [
        {"failures": 10},
        {"cut": 4},
        {"undecided": 4},
        {"failure_low": 0.9, "failure_high": 0.1},
        {"failure_low": 0.5},
    ],
)
def test_a_card_that_contradicts_itself_tells_no_failures(wrong: dict[str, float]) -> None:
    right = {"episodes": 5, "failures": 2, "failure_low": 0.05, "failure_high": 0.86}
    assert ReportedEpisodes(**right).rate is not None
    assert ReportedEpisodes(**(right | wrong)).rate is None


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


def test_results_of_unknown_seeds_are_not_from_the_same_starts() -> None:
    alone, shielded, *_ = (dataclasses.replace(one, seed=None) for one in read_results(CSV))
    assert pairs_of([alone, shielded])[0].alone is None


def test_how_many_episodes_a_number_rests_on_is_said_of_every_row() -> None:
    results = read_results(CSV)
    pairs = pairs_of(results)
    (rests, *_) = certainty(pairs, results, ReportedEpisodes())
    assert rests.startswith("Each number above rests on 100 episodes. 95 % intervals")
    alone, shielded, *others = results
    few = [alone, dataclasses.replace(shielded, episodes=3), *others[:1]]
    (rests, *_) = certainty(pairs_of(few), few, ReportedEpisodes())
    assert rests.startswith(
        "The numbers above rest on 3 episodes (novice, filtered) and 100 episodes (the novice "
        "alone; the expert alone). 95 % intervals"
    )


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
    assert html.count('<section class="slide"') == html.count("<article") + BESIDE_RULES == 8
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


def test_printing_ends_with_who_wants_it() -> None:
    with pytest.raises(CancelledError):
        document_to_pdf("<!doctype html><title>x</title>", lambda done, total: done > total)


def test_without_a_browser_a_pdf_is_refused_and_nothing_is_written(
    cart: Demonstrations, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BROWSER_PATH", "/nowhere/chromium")
    report = reported(cart)
    with pytest.raises(WorkError, match="the PDF could not be printed") as caught:
        report.save(tmp_path / "report.pdf")
    assert "write .html" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("does", "patience", "said"),
    [
        ("exec sleep 60", 0.1, "was not done after 0.1 seconds; try again when this machine"),
        ("exit 3", 60.0, "ended with code 3; make room"),
        ("exit 0", 60.0, "ended and wrote nothing; make room"),
    ],
)
def test_a_browser_that_does_not_print_is_not_told_to_be_missing(
    does: str, patience: float, said: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    browser = tmp_path / "browser"
    browser.write_text(f"#!/bin/sh\n{does}\n")
    browser.chmod(0o700)
    monkeypatch.setenv("BROWSER_PATH", str(browser))
    monkeypatch.setattr(pdf, "_PATIENCE", patience)
    with pytest.raises(WorkError) as refused:
        document_to_pdf("<!doctype html><title>x</title>")
    assert said in str(refused.value)
    assert str(refused.value).endswith("or write .html and print it from a browser")
    assert "install" not in str(refused.value)
