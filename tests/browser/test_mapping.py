"""The form for the columns: what is offered, an error that loses nothing, the names chosen."""

from __future__ import annotations

import numpy as np
from playwright.sync_api import Locator, Page, expect

from tests.browser.test_uploads import upload
from tests.browser.walking import metric, no_trace, settle, visit

N = 60
SPEED, GAP = np.random.default_rng(3).uniform(1, 60, (2, N)).round(1)


def table(header: str, *columns: object, delimiter: str = ",") -> bytes:
    """A CSV file of these columns, each of N values, and a run of 20 rows after the other."""
    runs = np.arange(N) // 20
    rows = [delimiter.join(map(str, row)) for row in zip(*columns, runs, strict=True)]
    return "\n".join([header, *rows, ""]).encode()


def preview(screen: Page, column: str) -> Locator:
    """What the form shows of a column."""
    rows = screen.get_by_label("The columns and their first rows").get_by_role("row")
    return rows.filter(has=screen.get_by_role("rowheader", name=column))


def chosen(screen: Page, field: str, *, form: str = "map") -> list[str]:
    """The columns that stand in a field of several."""
    tags = screen.locator(f".st-key-{form}_{field} .react-aria-ComboBox [data-tag]")
    return [text.strip() for text in tags.all_inner_texts()]


def choose(screen: Page, label: str, column: str) -> None:
    """Choose a column in a field."""
    field = screen.get_by_role("combobox", name=label)
    field.click()
    field.press_sequentially(column)
    screen.get_by_role("option", name=column, exact=True).click()
    screen.keyboard.press("Tab")
    settle(screen)


def read(screen: Page) -> None:
    screen.get_by_role("button", name="Read with these columns").click()
    settle(screen)


def test_a_choice_stays_after_an_error_and_is_read_once_it_is_right(screen: Page) -> None:
    pedal = np.where(GAP < 20, "brake", "go")
    lanes = np.arange(N) % 3
    header = "speed|gap|lane_id|operator_says|pressed|trip"
    content = table(header, SPEED, GAP, lanes, pedal, GAP, delimiter="|")
    upload(screen, ("rig.csv", content))

    expect(screen.get_by_text("say which in the form for the columns")).to_be_visible()
    expect(preview(screen, "gap")).to_contain_text(f"{GAP[0]:g}, {GAP[1]:g}")
    expect(preview(screen, "operator_says")).to_contain_text("words")
    expect(preview(screen, "operator_says")).to_contain_text("this one alone holds words")
    expect(preview(screen, "lane_id")).to_contain_text("unclear")
    assert chosen(screen, "observations") == ["speed", "gap", "pressed"]
    assert chosen(screen, "actions") == ["operator_says"]
    expect(screen.get_by_role("combobox", name="Episode")).to_have_value("trip")

    choose(screen, "Features", "lane_id")
    choose(screen, "Actions", "pressed")  # and it leaves the features
    assert chosen(screen, "observations") == ["speed", "gap", "lane_id"]
    screen.get_by_role("radio", name="an amount").click()
    settle(screen)
    screen.get_by_label("Least possible pressed").fill("100")
    screen.get_by_label("Least possible pressed").press("Tab")
    settle(screen)
    read(screen)
    form = screen.get_by_test_id("stExpanderDetails").filter(has_text="Which column is what?")
    expect(form.get_by_test_id("stAlert")).to_contain_text("give both, the least and the greatest")
    assert chosen(screen, "observations") == ["speed", "gap", "lane_id"]
    assert chosen(screen, "actions") == ["operator_says", "pressed"]
    expect(screen.get_by_label("Least possible pressed")).to_have_value("100")
    expect(screen.get_by_test_id("stMetricValue")).to_have_count(0)  # nothing was read yet

    screen.get_by_text("Map the columns myself").click()  # closed and opened, nothing is lost
    expect(screen.get_by_label("Least possible pressed")).not_to_be_visible()
    screen.get_by_text("Map the columns myself").click()
    settle(screen)
    assert chosen(screen, "observations") == ["speed", "gap", "lane_id"]
    assert chosen(screen, "actions") == ["operator_says", "pressed"]
    expect(screen.get_by_label("Least possible pressed")).to_have_value("100")

    choose(screen, "Step:", "pressed")
    assert chosen(screen, "actions") == ["operator_says"]
    choose(screen, "Reward", "pressed")
    read(screen)
    expect(screen.get_by_test_id("stMetricValue").first).to_have_text("60")
    assert metric(screen, "Episodes") == "3"
    expect(screen.get_by_text("Actions: operator_says")).to_be_visible()
    expect(screen.get_by_label("Distribution of lane_id")).to_be_visible()
    no_trace(screen)


def test_columns_of_1_and_0_are_offered_as_one_action(screen: Page) -> None:
    content = table("speed,gap,action_left,action_right,run", SPEED, GAP, GAP < 20, GAP > 45)
    upload(screen, ("turns.csv", content.replace(b"True", b"1").replace(b"False", b"0")))
    assert metric(screen, "Actions") == "2"
    expect(screen.get_by_text("are never 1 in the same row")).to_be_visible()
    offer = screen.get_by_text("These columns are one action")
    expect(offer).to_be_visible()
    offer.click()
    settle(screen)
    expect(screen.get_by_text("One action with the choices none, left, right.")).to_be_visible()
    read(screen)
    expect(screen.get_by_text("are never 1 in the same row")).to_have_count(0)
    assert metric(screen, "Actions") == "3"
    for choice in ("none", "left", "right"):
        expect(
            screen.locator(".js-plotly-plot").get_by_text(choice, exact=True).first
        ).to_be_visible()
    no_trace(screen)


def test_the_columns_of_a_log_are_said_on_the_page_audit(screen: Page) -> None:
    states = np.random.default_rng(5).normal(0, 0.05, (N, 4)).round(3)
    pushed = np.where(states[:, 2] > 0, "push right", "push left")
    names = "cart position;cart velocity;pole angle;pole angular velocity;pushed;lean;trip"
    content = table(names, *states.T, pushed, pushed, delimiter=";")
    visit(screen, "/audit?data=cartpole", "Audit")
    screen.locator("input[type=file]").first.set_input_files(
        {"name": "night.csv", "mimeType": "text/csv", "buffer": content}
    )
    expect(screen.get_by_text("there is no action column")).to_be_visible()
    settle(screen)
    read(screen)  # as nothing is chosen as the action yet
    form = screen.locator(".st-key-log_map_read").locator("xpath=..")
    expect(form.get_by_role("button", name="Save as columns.json")).to_have_count(0)
    expect(screen.get_by_text("There are no actions in the form")).to_be_visible()
    choose(screen, "Actions", "pushed")
    choose(screen, "Step:", "lean")  # which leaves the features, and is no number
    read(screen)
    expect(screen.get_by_text("which is no number")).to_be_visible()
    choose(screen, "Features", "lean")
    assert chosen(screen, "actions", form="log_map") == ["pushed"]
    read(screen)
    expect(screen.get_by_text("of the log is no feature of the rules")).to_be_visible()
    assert metric(screen, "Steps") == "60"
    no_trace(screen)
