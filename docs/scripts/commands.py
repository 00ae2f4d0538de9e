"""Writes the page of commands from the command line itself; mkdocs calls it for every page."""

from __future__ import annotations

from typing import Any

import typer

from sarl_core.cli.app import app

PLACE = "<!-- commands -->"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the commands where a page asks for them."""
    return markdown.replace(PLACE, commands_page()) if PLACE in markdown else markdown


def commands_page() -> str:
    """Each command with what it takes, as Markdown."""
    group: Any = typer.main.get_command(app)
    sections = []
    for name, command in group.commands.items():
        within = getattr(command, "commands", None)
        if within is None:
            sections.append(_section(name, command))
        else:
            sections.append(f"## {name}\n\n{command.help}")
            sections += [_section(f"{name} {one}", part, "###") for one, part in within.items()]
    return "\n\n".join(sections)


def _section(name: str, command: Any, level: str = "##") -> str:
    what = command.help.replace("python -m sarl_core", "sarl")
    head = "| takes | | |\n| --- | --- | --- |"
    rows = (
        _row(parameter) for parameter in command.params if not getattr(parameter, "hidden", False)
    )
    return f"{level} {name}\n\n{what}\n\n{head}\n" + "\n".join(rows)


def _row(parameter: Any) -> str:
    names = ", ".join(parameter.opts)
    if parameter.metavar:
        names = f"{names} {parameter.metavar}" if names.startswith("-") else parameter.metavar
    default = parameter.show_default if isinstance(parameter.show_default, str) else None
    if default is None and parameter.show_default and parameter.default is not None:
        default = None if isinstance(parameter.default, bool) else str(parameter.default)
    values = parameter.type_descriptor
    notes = [
        "needed" if parameter.required else "",
        "one of " + ", ".join(values.choices) if values.is_choice else "",
        f"default: {default}" if default else "",
    ]
    cells = (f"`{names}`", parameter.help or "", "; ".join(filter(None, notes)))
    return "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in cells) + " |"
