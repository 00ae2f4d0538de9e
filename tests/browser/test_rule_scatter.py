from __future__ import annotations

import re

from playwright.sync_api import Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit

# Where the middle of the largest dot stands on the screen, and how many rules it has.
LARGEST = """() => {
  const plot = [...document.querySelectorAll('.js-plotly-plot')].find(one => one._fullData
    && one._fullData.some(trace => trace.name === 'rules'))
  const trace = plot._fullData.find(one => one.name === 'rules')
  const {_size: size, xaxis, yaxis} = plot._fullLayout
  const at = trace.marker.size.indexOf(Math.max(...trace.marker.size))
  const box = plot.getBoundingClientRect()
  return [box.left + size.l + xaxis.d2p(trace.x[at]), box.top + size.t + yaxis.d2p(trace.y[at])]
}"""


def test_a_click_on_a_dot_opens_its_rules_one_by_one(screen: Page) -> None:
    visit(
        screen,
        "/rules?data=cartpole&support=0.001&confidence=0.9&show=Scatter+plot"
        "&across=Length&upwards=Merged+length",
        "Rules",
    )
    # What stands above the plot is there, so that it does not move any more.
    expect(screen.get_by_text(re.compile("judged by rules mined without it"))).to_be_visible()
    settle(screen)
    opened = []
    for _ in range(2):
        screen.mouse.click(*screen.evaluate(LARGEST))
        settle(screen)
        opened.append(parameters(screen)["rule"])
        place = len(opened)
        expect(screen.get_by_text(re.compile(f"The rule below is {place} of "))).to_be_visible()
    assert len(set(opened)) == 2
    # Other axes part them, and leave the rule that is open.
    screen.get_by_role("combobox", name="Upwards").click()
    screen.get_by_role("option", name="Lift").click()
    settle(screen)
    assert parameters(screen)["rule"] == opened[1]
    assert parameters(screen)["upwards"] == "Lift"
    no_trace(screen)
