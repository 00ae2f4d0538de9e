"""Choices that the URL holds, and that survive a change of page without a widget."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast
from urllib.parse import urlencode, urlsplit

import streamlit as st
from streamlit.delta_generator import DeltaGenerator
from streamlit.proto.WidgetStates_pb2 import WidgetState
from streamlit.runtime.scriptrunner import get_script_run_ctx
from streamlit.runtime.state import get_session_state
from streamlit.runtime.state.query_params import parse_url_param

from sarl_dashboard.text import escaped

_MOST = 2.0**53  # beyond it a browser's numbers are not whole any more


@dataclass
class _Address:
    """What a visit knows of its address, in one piece: it is looked at hundreds of times a run.

    Attributes:
        names: Parameters of choices that survive a change of page.
        waits: Whether what is said waits until everything beside the page is drawn.
        waiting: What the address will say, and does not yet.
        said: Parameters that this run has said something of while it waited.
        beside: What stands beside every page.
        left: Values that choices on this page have just replaced.
        order: Of the parameters, as the browser has them.
    """

    names: set[str] = field(default_factory=set)
    waits: bool = False
    waiting: dict[str, str | None] = field(default_factory=dict)
    said: set[str] = field(default_factory=set)
    beside: dict[str, str] = field(default_factory=dict)
    left: dict[str, str] = field(default_factory=dict)
    order: tuple[str, ...] = ()

    def value(self, name: str) -> str | None:
        """What the address says, or will say."""
        return self.waiting[name] if name in self.waiting else st.query_params.get(name)


def _address() -> _Address:
    return cast(_Address, st.session_state.setdefault("_url_state", _Address()))


def url_choice(name: str, options: Sequence[str], default: str) -> str:
    """A choice that the URL holds and that survives a change of page.

    Args:
        name: URL parameter.
        options: What it may be.
        default: Taken where the URL says nothing, or something else.

    Returns:
        One of `options`.
    """
    return url_text(name, default, lambda text: text in options)


def url_text(name: str, default: str, valid: Callable[[str], bool]) -> str:
    """A text that the URL holds and that survives a change of page.

    Args:
        name: URL parameter.
        default: Taken where the URL says nothing, or nothing valid.
        valid: Whether a text may be meant.

    Returns:
        The default, or a valid text.
    """
    address = _address()
    address.names.add(name)
    value = address.value(name)
    if value is not None and name not in address.waiting and _is_late(address, name, value):
        value = None  # the browser had not heard of the choice when it asked for this run
    if value is not None and not valid(value):
        note_unusable(name, value)
    if value is None or not valid(value):  # a change of page takes the parameters away
        value = str(st.session_state.get(f"_{name}", default))
    if not valid(value):
        value = default
    _choose(address, name, value, default)
    return value


def url_name(name: str, default: str = "") -> str:
    """The name of a thing, of whatever form: who looks for the thing says that there is none.

    Args:
        name: URL parameter.
        default: Taken where the URL says nothing.
    """
    return url_text(name, default, lambda text: True)


def set_url_choice(name: str, value: str, default: str = "") -> None:
    """Choose, from a widget's callback or by `url_choice`.

    Args:
        name: URL parameter.
        value: Its new value.
        default: Value that needs no place in the URL.
    """
    _choose(_address(), name, value, default)


def _choose(address: _Address, name: str, value: str, default: str) -> None:
    st.session_state[f"_{name}"] = value
    before = address.value(name)
    if address.left.get(name) == value:
        del address.left[name]
    if before not in (None, value):
        address.left[name] = before
    _say(address, name, None if value == default else value)


def say_in_url(name: str, value: str | None) -> None:
    """Let the URL say this of a parameter; what is a widget's says the widget.

    Until everything beside a page is drawn it waits (`write_url`): the browser's "back" goes
    through every address that was written, and one that says half of a change was never on screen.

    Args:
        name: URL parameter.
        value: None to leave it out.
    """
    _say(_address(), name, value)


def _say(address: _Address, name: str, value: str | None) -> None:
    context = get_script_run_ctx()
    if address.waits and not (context and context.fragment_ids_this_run):
        address.waiting[name] = value
        address.said.add(name)
    else:
        if address.beside.get(name) != value:
            address.beside.pop(name, None)
        _write({name: value})


def write_url() -> None:
    """Write what waits into the URL, in one piece; from here on nothing waits in this run."""
    address = _address()
    address.waits = False
    _write(address.waiting)
    # In the order of the address: the same in another order is another one to go back to.
    said = {name: address.waiting[name] for name in st.query_params if name in address.said}
    address.beside = {name: value for name, value in said.items() if value}
    address.waiting.clear()


def bring_along(now: Mapping[str, str | None]) -> None:
    """Give the URL of another page at once what stands beside every page.

    A link in the navigation names none of it. Before `st.navigation`: the browser writes the
    address of the page with what it has heard until then, and goes back to that.

    Args:
        now: What is said of it that a part of the last page may have changed since.
    """
    context = get_script_run_ctx()
    page = context.page_script_hash if context else ""
    before = st.session_state.get("_page_hash", page)
    st.session_state["_page_hash"] = page
    if page == before or (context and context.is_history_navigation):
        return
    address = _address()
    beside = {**address.beside, **now}
    _write_in_order(
        {name: one for name, one in beside.items() if one and address.value(name) is None}
    )


def _write_in_order(values: Mapping[str, str]) -> None:
    """Write into the URL what the browser's address has already, in the order that it has there.

    The same in another order would be another address to go back to.
    """
    with get_session_state().query_params() as url:
        if not values or any(url.is_bound(name) for name in url):
            _write(values)
            return
        there = {name: url.get_all(name) for name in url} | {
            name: [value] for name, value in values.items()
        }
        before = _address().order
        ordered = sorted(there, key=lambda name: (*before, name).index(name))
        for name in list(url):
            url.discard_param_no_forward_msg(name)
        url.update({name: there[name] for name in ordered})


def end_run(page: str) -> None:
    """Let what callbacks choose wait for the run that follows; see which of the link was nonsense.

    Args:
        page: Title of the page that has run.
    """
    _address().waits = True
    unusable = [*st.session_state.get("_unusable", ()), *_refused_by_widgets()]
    if unusable:
        before, _ = st.session_state.get("_left_out_of_link", ((), page))
        say_left_out(tuple(dict.fromkeys([*before, *unusable])), page)
        st.session_state["_unusable"] = []
    stay_beside()


def stay_beside() -> None:
    """Let what stands beside every page stay in the address when the page changes; after widgets.

    What a page's widgets are bound to, Streamlit takes out of the address before anything here
    runs: the browser would write an address without it, and go back to that.
    """
    address = _address()
    address.order = tuple(st.query_params)
    with get_session_state().query_params() as url:
        for name in address.said:
            if binding := url.get_binding_for_param(name):
                url.unbind_widget(binding.widget_id)


def note_unusable(name: str, value: str) -> None:
    """Note that what the link says of a parameter is nothing that it could be.

    Args:
        name: URL parameter.
        value: What was said; where it is no more what the link said, nothing is noted.
    """
    link = _link()
    if value and link.get(name, [""])[-1] == value:
        del link[name]
        st.session_state["_unusable"].append(name)


def leave_to_page(name: str) -> None:
    """Say nothing of what the link says of a parameter: its page says more than could be said here.

    Args:
        name: URL parameter.
    """
    _link().pop(name, None)


def _link() -> dict[str, list[str]]:
    """What the link that opened the page says, as far as nothing has made use of it yet."""
    return cast("dict[str, list[str]]", st.session_state.setdefault("_link", {}))


def _refused_by_widgets() -> list[str]:
    """Parameters of the link that widgets of this run took for something else.

    Streamlit gives a widget its usual value where the address has none for it, and says nothing.
    """
    context, link = get_script_run_ctx(), _link()
    if context is None or not link:
        return []
    drawn = context.shared.widget_ids_this_run.snapshot()
    states = {one.id: one for one in get_session_state().get_widget_states()}
    refused = []
    with get_session_state().query_params() as url:
        bindings = {name: url.get_binding_for_param(name) for name in link}
    for name, binding in bindings.items():
        if binding is None or binding.widget_id not in drawn or binding.widget_id not in states:
            continue
        said, state = link.pop(name), states[binding.widget_id]
        if f"_{name}_unknown" not in st.session_state and not _is_same(said, state):
            refused.append(name)
    return refused


def _is_same(said: list[str], state: WidgetState) -> bool:
    """Whether a widget's value is what a link says; where that is nothing, it is."""
    if not any(said):
        return True
    kind = state.WhichOneof("value")
    if kind is None:
        return False
    value = getattr(state, kind)
    try:
        meant = parse_url_param(said, kind)
    except ValueError:
        return False
    if isinstance(meant, list):
        return sorted(map(str, meant)) == sorted(map(str, value.data))
    return bool(meant == value)


def _write(values: Mapping[str, str | None]) -> None:
    with get_session_state().query_params() as url:
        free = {name: value for name, value in values.items() if not url.is_bound(name)}
        put = {name: value for name, value in free.items() if value not in (None, url.get(name))}
        gone = [name for name, value in free.items() if value is None and name in url]
        # One message to the browser, and so one address among those to go back to.
        for name in gone[0 if put else 1 :]:
            url.discard_param_no_forward_msg(name)
        if put:
            url.update(put)
        elif gone:
            del url[gone[0]]


def _is_late(address: _Address, name: str, value: str) -> bool:
    """Whether a value of the URL is the one that a choice on this page has just replaced.

    A browser that is asked for two runs in a row writes the old value into the second request. It
    comes back by being chosen, by a link from another page, or by the browser's "back".
    """
    return address.left.get(name) == value


def begin_run(page: str) -> None:
    """Let a URL that brings another page, or that "back" brings, say every value anew.

    Args:
        page: Title of the page that runs.
    """
    context, address = get_script_run_ctx(), _address()
    went_back = bool(context and context.is_history_navigation)
    if went_back:
        # An address that was on screen says everything: what it does not name has its default.
        for name in address.names:
            if name not in st.query_params:
                st.session_state.pop(f"_{name}", None)
    st.session_state["_went_back"] = went_back
    address.waits, address.said = True, set()
    if st.session_state.get("_page") != page or went_back:
        st.session_state["_page"] = page
        address.waiting.clear()
        address.left.clear()
        # What was on screen before was usable then.
        said = (
            {} if went_back else {name: st.query_params.get_all(name) for name in st.query_params}
        )
        st.session_state["_link"], st.session_state["_unusable"] = said, []


def page_title() -> str:
    """Of the page that a visitor looks at; "" before there is one."""
    return str(st.session_state.get("_page", ""))


def page_address() -> str:
    """Of the page that a visitor looks at, from where the dashboard begins; "" of the first one."""
    page = urlsplit(st.context.url or "").path.rsplit("/", 1)[-1]
    parameters = {name: st.query_params.get_all(name) for name in st.query_params}
    return f"{page}?{urlencode(parameters, doseq=True)}" if page else ""


def absurd_parameters() -> tuple[str, ...]:
    """URL parameters with a number that nothing here can be, as 1e999 or four hundred nines."""
    return tuple(
        name
        for name in st.query_params
        if any(_is_absurd(text) for text in st.query_params.get_all(name))
    )


def _is_absurd(text: str) -> bool:
    try:
        number = float(text)
    except ValueError:
        return False
    return not (math.isfinite(number) and abs(number) <= _MOST)


def without(names: Collection[str] = ()) -> dict[str, list[str]]:
    """The URL parameters but for some of them."""
    return {name: st.query_params.get_all(name) for name in st.query_params if name not in names}


def say_left_out(names: Sequence[str], page: str) -> None:
    """Remember that parameters of a link were left out, to be said on its page.

    Args:
        names: Of the URL parameters.
        page: Title of the page that the link opens.
    """
    st.session_state["_left_out_of_link"] = (tuple(names), page)


def show_left_out(page: str, place: DeltaGenerator) -> None:
    """Say what was left out of the link that opened a page, as long as one stays on it.

    Args:
        page: Title of the page that runs.
        place: Where to say it, at the top of it.
    """
    names, linked_page = st.session_state.get("_left_out_of_link", ((), page))
    if linked_page != page:
        del st.session_state["_left_out_of_link"]
    elif names:
        listed = ", ".join(escaped(name[:40]) for name in names[:5])
        place.warning(
            f"The link gives something that cannot be used for {listed}, so the usual was taken; "
            "check the address, or choose on this page.",
            icon=":material/link_off:",
        )


def with_own(options: tuple[str, ...], key: str) -> tuple[str, ...]:
    """Options of a select box that also takes typed ones, with the typed one among them.

    Args:
        options: The usual ones.
        key: Of the widget; it is bound to the URL.

    Returns:
        The options, and what was typed or came with the URL.
    """
    own = st.session_state.get(key) or st.query_params.get(key)
    return options if own is None or own in options else (*options, str(own))
