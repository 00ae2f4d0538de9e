"""The steps of a container file, run in roots of their own."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path


@dataclass(frozen=True)
class Image:
    """A root that steps were run in, and how a process begins in it.

    Attributes:
        root: Its files.
        environment: Of its processes.
        user: Name of the account that they run as.
        folder: Where they begin.
        command: What is run.
        volumes: Folders that are kept.
        healthcheck: What tells whether it works.
    """

    root: Path
    environment: Mapping[str, str] = field(
        default_factory=lambda: {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin"}
    )
    user: str = "root"
    folder: str = "/"
    command: tuple[str, ...] = ()
    volumes: tuple[str, ...] = ()
    healthcheck: tuple[str, ...] = ()

    @property
    def account(self) -> tuple[int, int]:
        """Numbers of its user and of the user's group."""
        for line in (self.root / "etc/passwd").read_text().splitlines():
            name, _, user, group, *_ = line.split(":")
            if name == self.user:
                return int(user), int(group)
        raise RuntimeError(f"{self.root} has no account {self.user}")


def steps(text: str) -> list[tuple[str, str]]:
    """Words and arguments of a container file, with the lines that go on joined."""
    kept = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))
    lines = re.sub(r"\\\n", " ", kept).splitlines()
    return [
        (word, rest.strip()) for word, _, rest in (line.partition(" ") for line in lines if line)
    ]


def built(
    file: Path,
    context: Path,
    base: Path,
    work: Path,
    given: Mapping[str, Path],
    *,
    again: bool = True,
) -> Image:
    """Run every step of a container file.

    Args:
        file: The container file.
        context: Folder that it copies from.
        base: Root that stands for every image that it begins from.
        work: Empty folder for the roots.
        given: Files and folders of this machine by where the steps see them, as what pip is set
            up by.
        again: Whether to run the steps; else only what they say of the image is read, of roots
            that are there.

    Returns:
        The last stage.

    Raises:
        CalledProcessError: If a step fails.
        RuntimeError: If one is of a kind that is not known here.
    """
    stages = dict[str, Image]()
    image: Image | None = None
    for number, (word, rest) in enumerate(steps(file.read_text())):
        if again:
            print(f"step {number + 1}: {word} {' '.join(rest.split())}"[:110], flush=True)
        if word == "FROM":
            name = rest.partition(" AS ")[2] or "last"
            root = work / name
            if again:
                subprocess.run(["cp", "--archive", base, root], check=True)
            image = stages[name] = Image(root)
            continue
        if image is None:
            raise RuntimeError(f"step {number + 1} of {file} stands before FROM")
        if again and word == "RUN":
            _run(image, rest, given)
        elif again and word == "COPY":
            _copy(image, rest, context, stages)
        image = _noted(image, word, rest)
    if image is None:
        raise RuntimeError(f"{file} has no FROM")
    return image


def _noted(image: Image, word: str, rest: str) -> Image:
    """What a step says of the processes of an image."""
    match word:
        case "ENV":
            pairs = dict(pair.split("=", 1) for pair in shlex.split(rest))
            return replace(image, environment={**image.environment, **pairs})
        case "USER":
            return replace(image, user=rest)
        case "WORKDIR":
            (image.root / rest.lstrip("/")).mkdir(parents=True, exist_ok=True)
            return replace(image, folder=rest)
        case "VOLUME":
            return replace(image, volumes=tuple(rest.split()))
        case "CMD":
            return replace(image, command=tuple(_list(rest)))
        case "HEALTHCHECK":
            return replace(image, healthcheck=tuple(_list(rest.partition("CMD ")[2])))
        case "RUN" | "COPY" | "EXPOSE":
            return image
        case _:  # no step is passed over
            raise RuntimeError(f"{word} is not known here")


def _list(text: str) -> list[str]:
    return [str(part) for part in json.loads(text)]


def _run(image: Image, command: str, given: Mapping[str, Path]) -> None:
    seen = [part for place, path in given.items() for part in ("--ro-bind", str(path), place)]
    settings = [
        part for name, value in image.environment.items() for part in ("--setenv", name, value)
    ]
    subprocess.run(
        [
            *("bwrap", "--bind", image.root, "/", "--proc", "/proc", "--dev", "/dev"),
            *("--ro-bind", "/etc/resolv.conf", "/etc/resolv.conf", *seen),
            *("--cap-add", "ALL", "--unshare-pid", "--die-with-parent", "--clearenv", *settings),
            *("--setenv", "DEBIAN_FRONTEND", "noninteractive", "--chdir", image.folder),
            *("sh", "-c", command),
        ],
        check=True,
    )


def _copy(image: Image, rest: str, context: Path, stages: Mapping[str, Image]) -> None:
    words = rest.split()
    source = context
    if words[0].startswith("--from="):
        source = stages[words.pop(0).removeprefix("--from=")].root
    *names, target = words
    into = image.root / (Path(image.folder) / target).as_posix().lstrip("/")
    for name in names:
        path = source / name.lstrip("/")
        if path.is_dir():
            into.mkdir(parents=True, exist_ok=True)
            subprocess.run(["cp", "--archive", f"{path}/.", into], check=True)
        else:
            place = into / path.name if target.endswith("/") else into
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, place)


def build_context(checkout: Path, ignore: Path, target: Path) -> None:
    """Copy what a container file may copy: of the checkout's own files, what is not left out.

    Args:
        checkout: The project.
        ignore: Its list of what is left out: everything, but for the names after "!".
        target: A folder that does not exist.

    Raises:
        RuntimeError: If the list is of another kind.
    """
    lines = ignore.read_text().split()
    if lines[0] != "*":
        raise RuntimeError(f"{ignore} does not begin with *")
    kept = tuple(line[1:] for line in lines if line.startswith("!"))
    files = subprocess.run(
        ["git", "ls-files", "-z"], cwd=checkout, check=True, capture_output=True, text=True
    ).stdout
    for name in files.split("\0"):
        if name in kept or name.startswith(tuple(f"{one}/" for one in kept)):
            place = target / name
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(checkout / name, place, follow_symlinks=False)
