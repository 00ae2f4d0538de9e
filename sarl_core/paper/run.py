"""Running studies one after another; what is finished is kept, whatever comes after."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from sarl_core.errors import InputError, quoted
from sarl_core.explaining.figures.png import drawing_pictures
from sarl_core.files import whole_file
from sarl_core.paper.chance import with_chance
from sarl_core.paper.replicates import fingerprints
from sarl_core.paper.report import Entry, PaperReport, read_report, write_report
from sarl_core.paper.sheets import SCRIPT, page, picture
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import FULL, Effort, Study
from sarl_core.paper.tables import read_table, write_table
from sarl_core.progress import Progress

if TYPE_CHECKING:
    import pandas as pd

Watch = Callable[[Study], AbstractContextManager[Progress | None]]
_PACKAGES = ("numpy", "scikit-learn", "gymnasium", "stable_baselines3", "torch")


def reproduce(
    folder: Path,
    studies: Sequence[Study] = tuple(STUDIES.values()),
    *,
    effort: Effort = FULL,
    watch: Watch = lambda _: nullcontext(None),
    finished: Callable[[str, Entry], None] = lambda name, entry: None,
) -> PaperReport:
    """Reproduce figures of the paper.

    Each study's files appear when it is finished, and with them its entry in ``report.json``. What
    an earlier run left in the folder stays until its study is finished anew. Pages follow from
    tables and entries alone, so all are written again, once and whenever their entry has changed;
    those that say the same stay the same.

    Args:
        folder: Where the files go; made where its parent exists.
        studies: Which, in this order.
        effort: How much work.
        watch: Gives, for the time of a study, whom to tell of its progress.
        finished: Told of each study that is finished.

    Returns:
        What the folder holds now.

    Raises:
        InputError: If the folder cannot be used.
        WorkError: If no browser is there to draw pictures, or a file cannot be written.
        CancelledError: If `watch` gave someone who wanted no more; what is finished is kept.
    """
    frames, report = _open(folder, studies)
    written: dict[str, Entry] = {}
    with drawing_pictures() as draw:
        _write_script(folder)
        for study in studies:
            started = time.monotonic()
            with watch(study) as progress:
                frames[study.name] = study.measure(effort, progress)
            entry = _entry(study, frames[study.name], effort)
            entries = {**report.studies, study.name: entry}
            report = PaperReport(
                {
                    name: _judged(entries[name], name, frames, anew=name == study.name)
                    for name in STUDIES
                    if name in entries
                }
            )
            content = picture(study, frames[study.name], draw)
            entry = replace(
                report.studies[study.name], seconds=round(time.monotonic() - started, 1)
            )
            report = PaperReport({**report.studies, study.name: entry})
            with whole_file(folder / entry.files["picture"]) as unfinished:
                unfinished.write_bytes(content)
            write_table(frames[study.name], folder / entry.files["table"])
            for name, one in report.studies.items():
                if name in frames and written.get(name) != one:
                    _write_page(folder, STUDIES[name], frames[name], one)
                    written[name] = one
            write_report(report, folder)
            finished(study.name, entry)
    return report


def _open(folder: Path, studies: Iterable[Study]) -> tuple[dict[str, pd.DataFrame], PaperReport]:
    """Make the folder, and read what an earlier run left there."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give a folder")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder {folder} cannot be made ({error.strerror or error}); choose another"
        ) from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"the folder {folder} cannot be written to; choose another")
    report = read_report(folder) or PaperReport()
    unknown = next((name for name in report.studies if name not in STUDIES), None)
    if unknown is not None:
        raise InputError(
            f"the report in {folder} has a study {quoted(unknown)} that this version does not "
            "know; choose another folder"
        )
    return _read_tables(folder, report, {study.name for study in studies}), report


def _read_tables(folder: Path, report: PaperReport, anew: set[str]) -> dict[str, pd.DataFrame]:
    """The tables of a report; a damaged one matters only if its study is not done anew."""
    frames, damaged = {}, {}
    for name, entry in report.studies.items():
        try:
            frames[name] = read_table(STUDIES[name], folder / entry.files["table"])
        except InputError as error:
            if name not in anew:
                damaged[name] = error
    if len(damaged) == 1:
        raise next(iter(damaged.values()))
    if damaged:
        files = ", ".join(report.studies[name].files["table"] for name in damaged)
        again = " ".join(f"--figure {name}" for name in damaged)
        raise InputError(
            f"in {folder}, {files} are missing or damaged; run `reproduce {again}` again"
        )
    return frames


def _judged(entry: Entry, name: str, frames: Mapping[str, pd.DataFrame], *, anew: bool) -> Entry:
    """An entry with its claims worked out again: some compare one figure with another."""
    if name not in frames:  # its table is damaged, and it is still to be done anew
        return entry
    study = STUDIES[name]
    before = tuple(replace(claim, by_chance=None) for claim in entry.claims)
    if not anew and before == study.claims(frames):
        return entry
    return replace(entry, claims=with_chance(study, frames))


def _entry(study: Study, frame: pd.DataFrame, effort: Effort) -> Entry:
    settings = study.settings(effort)
    own = settings.get("environments", [settings.get("environment")])
    quick = " --quick" if effort.quick else ""
    return Entry(
        place=study.place,
        title=study.title,
        quick=effort.quick,
        command=f"python -m sarl_core reproduce --figure {study.name}{quick} --out DIR",
        made=datetime.now(UTC).date().isoformat(),
        seconds=0.0,
        settings=settings,
        inputs={env_id: fingerprints(env_id, effort.recordings) for env_id in own},
        versions=_versions(),
        files={
            "table": f"{study.slug}.csv",
            "page": f"{study.slug}.html",
            "picture": f"{study.slug}.png",
        },
        numbers=study.numbers(frame),
        claims=(),
    )


def _versions() -> Mapping[str, str]:
    return {
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in _PACKAGES},
    }


def _write_page(folder: Path, study: Study, frame: pd.DataFrame, entry: Entry) -> None:
    with whole_file(folder / entry.files["page"]) as unfinished:
        unfinished.write_text(page(study, frame, entry), encoding="utf-8")


def _write_script(folder: Path) -> None:
    from plotly.offline import get_plotlyjs

    with whole_file(folder / SCRIPT) as unfinished:
        unfinished.write_text(get_plotlyjs(), encoding="utf-8")
