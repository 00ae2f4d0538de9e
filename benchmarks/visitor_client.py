"""A visitor without a browser: opens a page and moves its slider, through the socket of pages."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

from streamlit.proto.BackMsg_pb2 import BackMsg
from streamlit.proto.ForwardMsg_pb2 import ForwardMsg
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

_LOADING = 120.0  # seconds that a page may take to come
_TOKEN = "_streamlit_xsrf"  # the cookie without whose word nobody counts as signed in
_QUIET = 0.3  # seconds after the end of a run in which another may follow it


class VisitorClient:
    """A page that is open, and the slider in it.

    Attributes:
        errors: How many exceptions the page has shown.
    """

    def __init__(
        self,
        address: str,
        page: str,
        query: str,
        slider: str,
        *,
        cookies: Mapping[str, str] | None = None,
        door: Mapping[str, Any] | None = None,
    ) -> None:
        """Open the page.

        Args:
            address: Of the dashboard.
            page: Its path.
            query: Its parameters.
            slider: The label.
            cookies: Of a browser in which somebody has signed in.
            door: How to come to the address, as ``websockets.sync.client.connect`` takes it.
        """
        self.errors = 0
        self._page, self._query, self._label = page, query, slider
        self._id = self._fragment = ""
        self._options: list[str] = []
        socket = address.replace("http", "ws", 1) + "/_stcore/stream"
        cookies = cookies or {}
        protocols = ["streamlit", *filter(None, [cookies.get(_TOKEN)])]
        self._connection = connect(
            socket,
            subprotocols=[Subprotocol(name) for name in protocols],
            origin=Origin(address),
            max_size=None,
            additional_headers=(
                {"Cookie": "; ".join(map("=".join, cookies.items()))} if cookies else {}
            ),
            **(door or {}),
        )
        self._socket = self._connection.__enter__()
        self._send(self._message())

    def __enter__(self) -> Self:
        """Itself; in the end the page is closed."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the page."""
        self._connection.__exit__(kind, error, trace)

    def move(self, step: int) -> float:
        """Move the slider, and wait for all that follows.

        Args:
            step: Which of its values, from the middle.

        Returns:
            Seconds until the last of it was there.
        """
        message = self._message()
        message.rerun_script.fragment_id = self._fragment
        state = message.rerun_script.widget_states.widgets.add()
        state.id = self._id
        value = self._options[len(self._options) // 2 + step]
        state.string_array_value.data.append(value)
        return self._send(message)

    def _message(self) -> BackMsg:
        message = BackMsg()
        message.rerun_script.page_name = self._page
        message.rerun_script.query_string = self._query
        return message

    def _send(self, message: BackMsg) -> float:
        begun = time.perf_counter()
        self._socket.send(message.SerializeToString())
        ended: float | None = None
        while True:
            try:
                raw = self._socket.recv(timeout=_LOADING if ended is None else _QUIET)
            except TimeoutError:
                if ended is None:
                    raise
                return ended
            answer = ForwardMsg.FromString(raw)
            match answer.WhichOneof("type"):
                case "new_session":
                    ended = None
                case "script_finished":
                    ended = time.perf_counter() - begun
                case "delta":
                    self._take(answer)

    def _take(self, answer: ForwardMsg) -> None:
        element = answer.delta.new_element
        kind = element.WhichOneof("type")
        self.errors += kind == "exception"
        if kind == "slider" and element.slider.label == self._label:
            self._id, self._fragment = element.slider.id, answer.delta.fragment_id
            self._options = list(element.slider.options)
