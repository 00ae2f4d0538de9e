"""The steps of many episodes in a browser: a row of another episode brings its replay."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import Page, expect

from sarl_core import Shield, load_demonstrations, mine_rules, rollout
from sarl_core.mining.language import number_text
from tests.browser.test_replay_steps import SEED, cells, press_row, replay
from tests.browser.walking import PATIENCE, metric, no_trace, parameters, settle

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


def choose_episode(screen: Page, seed: int) -> None:
    episodes = screen.get_by_role("combobox", name="Episode of seed")
    episodes.evaluate("box => box.scrollIntoView({block: 'center'})")  # a scrolled list closes
    episodes.click()
    episodes.fill(str(seed))
    screen.get_by_role("option", name=str(seed), exact=True).click()
    expect(cells(screen).first).to_have_text(str(seed))
    settle(screen)


def test_a_row_of_another_episode_brings_its_replay(screen: Page) -> None:
    rules = mine_rules(
        load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.95
    )
    several = rollout("CartPole-v1", "novice", shield=Shield(rules), episodes=8, seed=SEED)
    steps = several.steps
    assert steps is not None
    replay(screen)
    screen.get_by_role("button", name="Run 20 episodes").click()
    screen.locator(".st-key-comparison").wait_for(timeout=PATIENCE)
    settle(screen)
    screen.get_by_text("all episodes", exact=True).click()
    settle(screen)
    # The second time the slider has a step already, and is another one: as long as the episode.
    for episode, step in ((7, 5), (3, 2)):
        seed = SEED + episode
        choose_episode(screen, seed)
        press_row(screen, step)
        expect(screen.get_by_role("spinbutton", name="Seed")).to_have_value(str(seed))
        settle(screen)
        slider = screen.get_by_role("slider", name="Step")
        expect(slider).to_have_attribute("aria-valuetext", str(step), timeout=PATIENCE)
        words = screen.locator(".sarl-step")
        state = steps.observation[(steps.episode == episode) & (steps.step == step)][0]
        for value in state.tolist():
            expect(words).to_contain_text(number_text(value))
        chosen = screen.locator(".st-key-recorder_table tr[aria-selected='true'] td")
        expect(chosen.nth(1)).to_have_text(str(step))
        expect(chosen.first).to_have_text(str(seed))
        assert metric(screen, "Length with rules") == f"{int(several.lengths[episode]):,}"
        assert parameters(screen)["seed"] == str(seed)
    assert parameters(screen)["step"] == "2"
    no_trace(screen)
