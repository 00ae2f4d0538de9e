"""What the server logs, as one JSON object a line."""

from __future__ import annotations

import json
import logging
import os
from datetime import UTC, datetime
from typing import Any

from streamlit import config
from streamlit.logger import update_formatter

VARIABLE = "SARL_LOG"
"""The environment variable that asks for it, by the value "json"."""

_USUAL = frozenset(vars(logging.makeLogRecord({}))) | {
    *("line", "message", "asctime", "taskName"),
    "color_message",  # the same once more, for a terminal
}
_PLAIN = (str, int, float, bool, type(None))


class _LogLine:
    """A record as JSON, written when it is needed: by then it has all that it will have."""

    def __init__(self, record: logging.LogRecord) -> None:
        self._record = record

    def __str__(self) -> str:
        record = self._record
        said: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        for name, value in vars(record).items():
            if name not in _USUAL:
                said[name] = value if isinstance(value, _PLAIN) else str(value)
        if record.exc_info:
            said["trace"] = logging.Formatter().formatException(record.exc_info)
            record.exc_info = None  # or it would follow in lines of its own
        return json.dumps(said)


def write_json_lines() -> None:
    """Let all that is logged from here on be JSON, where the environment asks for it."""
    if os.environ.get(VARIABLE, "").strip().lower() != "json":
        return
    usual = logging.getLogRecordFactory()

    def with_line(*args: Any, **kwargs: Any) -> logging.LogRecord:
        record = usual(*args, **kwargs)
        record.line = _LogLine(record)
        return record

    logging.setLogRecordFactory(with_line)
    logging.basicConfig(format="%(line)s", level=logging.INFO, force=True)
    logging.captureWarnings(True)
    # Streamlit and the server below it have handlers of their own.
    config.set_option("logger.messageFormat", "%(line)s")
    update_formatter()
