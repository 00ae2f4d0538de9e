"""``python -m benchmarks.deployment``: build, serve and visit the server of the example.

As root, on Debian with debootstrap, bubblewrap, iproute2, curl, openssl, nginx, PostgreSQL and
Chromium.
No container engine is needed: each step of the container file is run in a root of its own.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.chromium import ROOT
from benchmarks.deployment.container import Image, build_context, built
from benchmarks.deployment.machines import HOST, deployed, network
from benchmarks.deployment.visit import PEOPLE, SERVER, visited
from benchmarks.measure import print_rows
from tests.browser.identity import identity_provider, secrets_text

EXAMPLE = ROOT / "examples" / "deployment"
MIRROR = "http://deb.debian.org/debian"


def main() -> int:
    """Do it all, and say each thing that was seen.

    Returns:
        0 if every figure was reached.
    """
    options = argparse.ArgumentParser(
        prog="python -m benchmarks.deployment", description=(__doc__ or "").partition("\n")[0]
    )
    options.add_argument("--work", type=Path, default=ROOT / "out" / "deployment")
    options.add_argument("--quick", action="store_true", help="fewer moves")
    options.add_argument("--built", action="store_true", help="take the image that is there")
    options.add_argument(
        "--given",
        action="append",
        default=[],
        metavar="SOURCE:PLACE",
        help="a file or folder of this machine that the build sees, as what pip is set up by",
    )
    chosen = options.parse_args()
    if os.geteuid():
        raise SystemExit("error: only root may give processes a root and a network of their own")
    work: Path = chosen.work.resolve()
    image = _image(work, chosen.given, again=not chosen.built)
    folder = work / "run"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    with (
        network(),
        identity_provider(PEOPLE, HOST) as provider,
        deployed(EXAMPLE, image, folder, secrets_text(provider, SERVER)) as deployment,
    ):
        rows = list(visited(deployment, 20 if chosen.quick else 60))
    print_rows(rows)
    return 0 if all(row.passed for row in rows) else 1


def _image(work: Path, given: Sequence[str], *, again: bool) -> Image:
    """The image, beginning with Debian's smallest system."""
    context, debian, roots = work / "context", work / "debian", work / "roots"
    if again:
        for made in (context, debian, roots):
            shutil.rmtree(made, ignore_errors=True)
        roots.mkdir(parents=True)
        subprocess.run(
            ["debootstrap", "--variant=minbase", "bookworm", debian, MIRROR],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        build_context(ROOT, EXAMPLE / "Containerfile.dockerignore", context)
    places = {place: Path(source) for source, place in (one.split(":") for one in given)}
    return built(EXAMPLE / "Containerfile", context, debian, roots, places, again=again)


if __name__ == "__main__":
    sys.exit(main())
