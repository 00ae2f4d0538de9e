"""The exported file and its test vectors, written once for each choice."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations, observed_features
from sarl_core.errors import SarlError
from sarl_core.explaining.exports.export import (
    Prepared,
    export_content,
    export_vectors,
    prepare,
    vectors_name,
)
from sarl_core.explaining.words.sign_off import SignOff, sign_off_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_dashboard.cache import cached
from sarl_dashboard.components.downloads import LARGE, PackedFile, download
from sarl_dashboard.state.sign_off import sign_off_here
from sarl_dashboard.text import escaped, refuse
from sarl_dashboard.views.export.settings import ExportSettings

LINES = 150
MOST_SIGNS = 60_000  # of those lines; a browser takes seconds to colour many more
LONGEST = MOST_SIGNS // LINES  # of a line, where together they have more


@cached(show_spinner="Rounding, and counting what changes …")
def prepared_for(
    rule_set: RuleSet, demonstrations: Demonstrations | None, *, merged: bool
) -> Prepared:
    """Rules rounded and merged as was asked.

    Args:
        rule_set: To carry away.
        demonstrations: On which no decision may change; None for no rounding.
        merged: Whether conditions on one feature become one interval.

    Returns:
        The rules, and what rounding did.

    Raises:
        SarlError: If there is nothing to export, or the demonstrations are for other rules.
    """
    return prepare(rule_set, merged=merged, demonstrations=demonstrations)


@dataclass(frozen=True, eq=False)
class ExportedFile:
    """A file to carry away, and what is seen of it.

    Attributes:
        file: All of it.
        lines: How many it has, and the first of them; none where it is no text.
        beginning: At most `LINES` of them; where they are long, each as far as `LONGEST`.
        cut: Whether one of them goes on.
    """

    file: PackedFile
    lines: int
    beginning: str
    cut: bool

    @classmethod
    def of(cls, content: bytes, *, text: bool) -> ExportedFile:
        """Take a file's content."""
        end = 0
        for _ in range(LINES if text else 0):
            end = content.find(b"\n", end) + 1 or len(content)
        count = content.count(b"\n") + (not content.endswith(b"\n")) if text else 0
        lines = content[:end].decode().rstrip("\n").split("\n")
        short = lines
        if sum(map(len, lines)) > MOST_SIGNS:
            short = [line if len(line) <= LONGEST else f"{line[:LONGEST]} …" for line in lines]
        return cls(PackedFile.of(content), count, "\n".join(short), short != lines)


@cached(show_spinner="Writing …", hash_funcs={SignOff: sign_off_text})
def file_of(
    rule_set: RuleSet, suffix: str, projection: Projection, sign_off: SignOff | None
) -> ExportedFile:
    """The file."""
    content = export_content(rule_set, suffix, projection, sign_off=sign_off)
    return ExportedFile.of(content, text=suffix != ".onnx")


@cached()
def vectors_of(rule_set: RuleSet, projection: Projection) -> bytes:
    """Its test vectors, made when asked for."""
    return export_vectors(rule_set, projection)


def show_file(rule_set: RuleSet, settings: ExportSettings) -> None:
    """The file: its beginning, and the downloads.

    Args:
        rule_set: As it is exported.
        settings: What was asked for.
    """
    form, projection = settings.form, settings.projection
    sign_off = sign_off_here(rule_set)
    try:
        file = file_of(rule_set, form.suffix, projection, sign_off)
    except SarlError as error:
        refuse(error)
        return
    name = f"{settings.stem}{form.suffix}"
    with st.container(horizontal=True, vertical_alignment="center"):
        download(
            f"Download {form.suffix}",
            file.file.content,
            name,
            key="carry_download",
            look="primary",
            large=file.file.size >= LARGE,
        )
        download(
            "Test vectors",
            partial(vectors_of, rule_set, projection),
            vectors_name(name),
            key="carry_vectors",
            icon="fact_check",
            meaning="States at every threshold and one step either side, with the rule and the "
            "action that must come out",
        )
        st.caption(f"{form.meaning} {file.file.size / 1024:,.1f} kB.")
    if sign_off is not None:
        st.caption(escaped(sign_off_text(sign_off)))
        before = sign_off_here(settings.rule_set)
        if before is not None and before.approvals and not sign_off.approvals:
            st.info(
                "What was approved are the rules before they were rounded or merged here: switch "
                "“Round thresholds” and “Merge conditions” off to carry those away, or keep these "
                "below and have them approved.",
                icon=":material/verified:",
            )
    if form.suffix == ".onnx":
        kind = "int64" if not rule_set.actions[0].is_interval else "float32"
        width = len(observed_features(rule_set.source.features))
        st.markdown(
            f"Inputs: `state` (B, {width}) float32 and `proposed` "
            f"(B, {len(rule_set.actions)}) {kind}. Outputs: `executed`, alike, `rule` "
            "int64, the index of the rule in force or -1, and `invalid` (B, 1), whether the state "
            "or the action is none that the rules can be asked about."
        )
        return
    st.code(file.beginning, language=form.language, height=460, line_numbers=True)
    if file.lines > LINES:
        more = f", each as far as {LONGEST:,} signs" if file.cut else ""
        st.caption(f"The first {LINES} of {file.lines:,} lines{more}.")
    elif file.cut:
        st.caption(f"Each line as far as {LONGEST:,} signs.")
