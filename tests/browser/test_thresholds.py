from __future__ import annotations

import re

from playwright.sync_api import Page, WebSocket, expect
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg

from tests.browser.walking import metric, no_trace, settle, visit


def test_a_released_slider_runs_one_fragment_and_draws_no_map_again(screen: Page) -> None:
    messages: list[ForwardMsg] = []

    def listen(socket: WebSocket) -> None:
        socket.on(
            "framereceived", lambda frame: messages.append(ForwardMsg.FromString(bytes(frame)))
        )

    screen.on("websocket", listen)
    visit(screen, "/thresholds?data=cartpole", "Thresholds")
    screen.locator(".st-key-maps .js-plotly-plot .heatmaplayer image").nth(1).wait_for()
    # Until what the rules are worth elsewhere is known, the page looks for it every second.
    expect(screen.get_by_text(re.compile("^elsewhere")).first).to_be_visible()
    settle(screen)
    rules = metric(screen, "Rules")
    messages.clear()
    screen.get_by_role("slider", name="Minimum support").press("ArrowLeft")
    settle(screen)
    assert metric(screen, "Rules") != rules
    ended = [
        message.script_finished
        for message in messages
        if message.WhichOneof("type") == "script_finished"
    ]
    assert ended == [ForwardMsg.FINISHED_FRAGMENT_RUN_SUCCESSFULLY]
    drawn = {
        message.delta.new_element.WhichOneof("type")
        for message in messages
        if message.delta.WhichOneof("type") == "new_element"
    }
    assert {"metric", "dataframe"} <= drawn
    assert "plotly_chart" not in drawn
    no_trace(screen)
