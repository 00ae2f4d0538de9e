"""Table 1: the two named settings, and the rule sets that they give."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sarl_core.explaining.language import share_text
from sarl_core.mining.rules import NAMED_SETTINGS
from sarl_core.reproducing.shipped import (
    PAPER_DIVIDER,
    demonstrations_of,
    environment_name,
    environments,
    named_rules,
)
from sarl_core.reproducing.study import Claim, Drawing, Effort, Frames, Study, judge
from sarl_core.reproducing.words import percent
from sarl_core.rollouts.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = (
    "environment",
    "setting",
    "support",
    "confidence",
    "divider",
    "rule_count",
    "mean_length",
    "coverage",
    "fidelity",
)
_COMPACT = 0.1  # of the unfiltered rules
_EVERY_STATE = 0.995
_ALL = "all environments"


def measure(_: Effort, progress: Progress | None) -> pd.DataFrame:
    """Mine the two named rule sets of every shipped environment.

    Args:
        _: Takes a few seconds, whatever the effort.
        progress: Called with (environments done, in all); returning False stops.

    Returns:
        One row a rule set; columns `environment`, `setting`, its `support` and `confidence`,
        `divider` (0 for discrete actions), `rule_count`, `mean_length`, `coverage`, `fidelity`.
    """
    import pandas as pd

    ids = environments()
    rows = []
    report(progress, 0, len(ids))
    for done, env_id in enumerate(ids, 1):
        discrete = demonstrations_of(env_id).is_discrete
        for name, rules in named_rules(env_id).items():
            rows.append(
                {
                    "environment": env_id,
                    "setting": name,
                    "support": rules.thresholds.support,
                    "confidence": rules.thresholds.confidence,
                    "divider": 0 if discrete else PAPER_DIVIDER,
                    "rule_count": rules.rule_count,
                    "mean_length": rules.mean_length,
                    "coverage": rules.coverage,
                    "fidelity": rules.fidelity,
                }
            )
        report(progress, done, len(ids))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _numbers(frame: pd.DataFrame) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for row in frame.to_dict("records"):
        kept = ("rule_count", "mean_length", "coverage", "fidelity")
        found.setdefault(row["environment"], {})[row["setting"]] = {
            name: row[name] for name in kept
        }
    return found


def _settings(_: Effort) -> dict[str, Any]:
    return {
        **{
            name: {"support": setting.support, "confidence": setting.confidence}
            for name, setting in NAMED_SETTINGS.items()
        },
        "divider": PAPER_DIVIDER,
        "environments": list(environments()),
        "seeds": {"tree": 0},
    }


def settings_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the two rule sets themselves.

    Args:
        frames: With the table of Table 1.

    Returns:
        Its claims and ours.
    """
    frame = frames["table-1"]
    filtered = frame[frame["setting"] == "filtered"].set_index("environment")
    unfiltered = frame[frame["setting"] == "unfiltered"].set_index("environment")
    shares = (filtered["rule_count"] / unfiltered["rule_count"]).to_dict()
    covered = unfiltered["coverage"].to_dict()
    counts = "; ".join(
        f"{environment_name(str(env_id))} {int(filtered['rule_count'][env_id]):,} of "
        f"{int(unfiltered['rule_count'][env_id]):,}"
        for env_id in filtered.index
    )
    least = min(covered, key=lambda env_id: covered[env_id])
    return (
        Claim(
            paper="Filtering by support and confidence gives a compact rule set.",
            where="Lessons Learned, Table 1",
            ours=f"Filtered rules of the unfiltered ones: {counts}.",
            verdict=judge(max(shares.values()) <= _COMPACT, min(shares.values()) <= _COMPACT),
            decided_by=f"Agrees if at most {percent(_COMPACT)} of the rules remain, in every "
            "environment; partly, in some.",
            numbers={f"share_{env_id}": float(share) for env_id, share in shares.items()},
        ),
        Claim(
            paper="The unfiltered rule set has an action for every state.",
            where="text on Figure 4",
            ours=f"Its rules cover {share_text(float(covered[least]))} of the demonstrated states "
            "or more"
            + (
                f"; least on {environment_name(str(least))}, where some equal states were shown "
                "with different actions."
                if covered[least] < 1
                else "."
            ),
            verdict=judge(covered[least] >= _EVERY_STATE, max(covered.values()) >= _EVERY_STATE),
            decided_by=f"Agrees from {100 * _EVERY_STATE:g} % in every environment; partly, in "
            "some.",
            numbers={f"coverage_{env_id}": float(share) for env_id, share in covered.items()},
        ),
    )


def _draw(frame: pd.DataFrame, _: str, dark: bool) -> tuple[Drawing, ...]:
    from sarl_core.explaining.settings_figures import settings_figure

    rows = [
        (environment_name(str(row["environment"])), str(row["setting"]), row)
        for row in frame.to_dict("records")
    ]
    counts = [(name, setting, float(row["rule_count"])) for name, setting, row in rows]
    covered = [(name, setting, float(row["coverage"])) for name, setting, row in rows]
    return (
        Drawing(
            "Number of rules",
            settings_figure(counts, title="rules", share=False),
            alt="Number of rules of the filtered and the unfiltered rule set of each environment",
        ),
        Drawing(
            "Coverage: share of the demonstrated states with a rule",
            settings_figure(covered, title="coverage", share=True),
            alt="Coverage of the filtered and the unfiltered rule set of each environment",
        ),
    )


SETTINGS = Study(
    name="table-1",
    place="Table 1",
    title="The two named settings",
    about="The rule sets at the paper's two named settings, filtered (support 0.005, confidence "
    "0.95) and unfiltered (support 0, confidence 1), for every environment. They are meant by "
    "these words wherever they stand. A rule needs at least these values; under the paper's "
    "Algorithm 1, which asks for more than them, the unfiltered set would be empty.",
    measure=measure,
    settings=_settings,
    numbers=_numbers,
    claims=settings_claims,
    parts=lambda frame: (_ALL,),
    draw=_draw,
    columns=_COLUMNS,
)
