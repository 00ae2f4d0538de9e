"""Runs what the README and the guide tell a reader to run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def run(command: list[str], folder: Path, *, library: Path | None = None) -> str:
    """Run a command as a reader would, and give what it prints.

    Args:
        command: And its arguments; `python` is the interpreter that runs the tests.
        folder: Where; what lies in its folder bin is a command.
        library: A checkout that counts as installed; None where the folder has its own.
    """
    places = [str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]]
    environment = {**os.environ, "PATH": os.pathsep.join(places)}
    if library is not None:
        environment["PYTHONPATH"] = str(library)
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    spoken = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    assert spoken == []
    return done.stdout
