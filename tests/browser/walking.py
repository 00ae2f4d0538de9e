"""What a person does in the dashboard, said once."""

from __future__ import annotations

import warnings
from urllib.parse import parse_qs, urlsplit

from playwright.sync_api import Locator, Page, TimeoutError, expect
from streamlit.proto.BackMsg_pb2 import BackMsg

PATIENCE = 60_000


def visit(screen: Page, path: str, title: str) -> None:
    """Open a page and wait until it has been written to the end."""
    screen.goto(path)
    expect(screen.get_by_role("heading", name=title, level=1)).to_be_visible(timeout=PATIENCE)
    settle(screen)


# When the page last asked for a run, and when a run last ended. The first byte of what it sends
# tells the field of the message that is set.
RUNS = """
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (message) {
  const bytes = message.buffer ? new Uint8Array(message.buffer, message.byteOffset, 1)
    : message instanceof ArrayBuffer ? new Uint8Array(message, 0, 1) : [0];
  if (bytes[0] >> 3 === RERUN) window.lastAsked = performance.now();
  return send.call(this, message);
};
new MutationObserver(() => {
  const state = document.querySelector('[data-test-script-state]')
    ?.getAttribute('data-test-script-state');
  if (state === 'notRunning' && window.lastState !== state) window.lastEnded = performance.now();
  window.lastState = state;
}).observe(document, {subtree: true, attributeFilter: ['data-test-script-state']});
""".replace("RERUN", str(BackMsg.DESCRIPTOR.fields_by_name["rerun_script"].number))


# Whether the run that was last asked for has ended, all parts of the page are there (Streamlit
# fetches the code of some of them, of charts for one, when it first needs it), and the page has
# stood still. A run may end so soon that the page never says that it runs.
STILL = """
([quiet, since]) => {
  if (window.lastChange === undefined) {
    window.lastChange = performance.now();
    window.changed = [];
    new MutationObserver(changes => {
      window.lastChange = performance.now();
      window.changed = [...window.changed, ...changes].slice(-20);
    }).observe(document.body, {subtree: true, childList: true, characterData: true});
  }
  const waits = window.lastAsked !== undefined && !(window.lastEnded > window.lastAsked);
  return (!waits || Date.now() - since > 5000)
    && document.querySelector('[data-test-script-state]')
      ?.getAttribute('data-test-script-state') === 'notRunning'
    && document.querySelector('[data-testid=stSkeleton]') === null
    && performance.now() - window.lastChange > quiet;
}
"""


# Why the page does not come to rest.
RESTLESS = """
() => {
  const state = document.querySelector('[data-test-script-state]')
    ?.getAttribute('data-test-script-state');
  const named = node => node.nodeName + (node.dataset?.testid ? ` ${node.dataset.testid}` : '')
    + ` "${(node.textContent ?? '').slice(0, 60)}"`;
  const within = node => (node.nodeType === 1 ? node : node.parentElement)
    ?.closest('[data-testid]')?.dataset.testid;
  const since = time => time === undefined ? 'never' : Math.round(performance.now() - time);
  return [
    `state ${state}; milliseconds since a run was asked for ${since(window.lastAsked)}, since one `
    + `ended ${since(window.lastEnded)}, since the last change ${since(window.lastChange)}`,
    ...[...document.querySelectorAll('[data-testid=stSkeleton]')].map(
      node => `a skeleton in ${within(node.parentElement)}`),
    ...(window.changed ?? []).map(change => `${change.type} in ${within(change.target)}: `
      + [...change.addedNodes].map(node => `+ ${named(node)}`).join(' ')
      + [...change.removedNodes].map(node => `- ${named(node)}`).join(' ')),
  ].join('\\n');
}
"""


# Whatever the page has sent by now is with the server when that has answered two questions.
ANSWERED = """
async () => { for (let i = 0; i < 2; i++) await fetch('/_stcore/health').catch(() => null) }
"""


def settle(screen: Page) -> None:
    """Wait until the script has run to its end, and what it sent is drawn.

    A page that does not come to rest fails nothing here, for what is looked at next says whether
    it is there; why it did not is told in the summary of the tests.
    """
    screen.wait_for_timeout(150)  # until a press is sent
    # A table that was just drawn says a little later what is selected in it, and asks for a run.
    for _ in range(2):
        screen.evaluate(ANSWERED)
        try:
            rest(screen)
        except TimeoutError:
            with warnings.catch_warnings():
                warnings.simplefilter("default")
                text = f"no rest on {screen.url}\n{screen.evaluate(RESTLESS)}"
                warnings.warn(text, stacklevel=2)


def rest(screen: Page, *, patience: float = PATIENCE) -> None:
    """Wait until a page stands still, or raise.

    Args:
        screen: The page.
        patience: Milliseconds.
    """
    since = screen.evaluate("Date.now()")
    # Not with each frame that is drawn, as by default: a browser that draws none would never look.
    screen.wait_for_function(STILL, arg=[250, since], polling=50, timeout=patience)


def metric(screen: Page, label: str) -> str:
    """The value of a metric."""
    own = screen.get_by_text(label, exact=True)
    found = screen.get_by_test_id("stMetric").filter(has=own)
    value = found.get_by_test_id("stMetricValue")
    card = screen.locator(".sarl-numbers div").filter(has=own).locator("dd")
    return value.or_(card).first.inner_text().strip()


def parameters(screen: Page) -> dict[str, str]:
    """What the URL says."""
    return {name: values[0] for name, values in parse_qs(urlsplit(screen.url).query).items()}


def addresses(screen: Page) -> int:
    """How many the browser goes through."""
    return int(screen.evaluate("history.length"))


def rules_choice(screen: Page) -> Locator:
    """Which rules are in force, in the sidebar."""
    return screen.get_by_test_id("stSidebar").get_by_role("combobox", name="Rules")


def no_trace(screen: Page) -> None:
    """No page shows an exception."""
    assert screen.get_by_test_id("stException").count() == 0
