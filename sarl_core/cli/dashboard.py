"""The command that starts the dashboard."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.errors import WorkError


def app(
    port: Annotated[
        int, typer.Option("--port", min=1, max=65535, help="Where it listens, on this machine.")
    ] = 8501,
) -> None:
    """Start the dashboard; Ctrl-C ends it.

    Example: `python -m sarl_core app --port 8600`
    """
    script = _script()
    terminal.print_lines([f"The dashboard is at http://localhost:{port} (Ctrl-C ends it)."])
    sys.stdout.flush()
    command = [sys.executable, "-m", "streamlit", "run", str(script), "--server.port", str(port)]
    with subprocess.Popen(command) as server:
        try:
            code = server.wait()
        except KeyboardInterrupt:
            server.terminate()
            return
    if code:
        raise WorkError(f"the dashboard ended with code {code}; what it printed says why")


def _script() -> Path:
    """The script that Streamlit runs: within the installed package, or in the checkout."""
    for needed in ("streamlit", "sarl_dashboard"):
        if importlib.util.find_spec(needed) is None:
            raise ModuleNotFoundError(f"No module named {needed!r}", name=needed)
    spec = importlib.util.find_spec("sarl_dashboard")
    assert spec is not None
    assert spec.origin is not None
    package = Path(spec.origin).parent
    installed = package / "app.py"
    return installed if installed.is_file() else package.parent / "app.py"
