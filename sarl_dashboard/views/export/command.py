"""The commands that make exported rules again."""

from __future__ import annotations

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.report.provenance import command_line, mining_command
from sarl_core.library.items import PREFIX
from sarl_dashboard.state import library
from sarl_dashboard.state.data import SHIPPED_SETS, chosen_dataset, raw_demonstrations, upload_name
from sarl_dashboard.views.export.settings import ExportSettings


def command_of(chosen: ExportSettings, demonstrations: Demonstrations) -> str:
    """What makes the rules again from the data, as far as commands do.

    Args:
        chosen: What is exported, and how.
        demonstrations: The chosen ones.

    Returns:
        "" for rules that were edited or came from elsewhere, and where episodes are held out or
        left out or things have other names than in the file.
    """
    raw, name = raw_demonstrations(), chosen_dataset()
    if raw is None or raw.digest != demonstrations.deriving(raw.derived).digest:
        return ""
    data = f"data/demonstrations/{name}.parquet" if name in SHIPPED_SETS else upload_name()
    if library.is_id(name):
        data = f"{PREFIX}{name}"
    mined = mining_command(chosen.rule_set, "rules.json", data, demonstrations, read=raw)
    if mined is None or not (chosen.rounded or chosen.merged):
        return mined or ""
    again = command_line(
        "export",
        "rules.json",
        {
            "--merged": True if chosen.merged else None,
            "--rounded": True if chosen.rounded else None,
            "--demonstrations": data if chosen.rounded else None,
            "--out": "exported.json",
        },
    )
    return f"{mined}\n{again}"
