"""A report: one HTML file that opens without a network, for people who know only the domain.

The parts are worked out first, each by a module of its own; the template only puts them in place,
and escapes every text. What is drawn comes as SVG from `svg`, without script.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from pathlib import Path
from typing import Any

from sarl_core.agents.agent import Agent, has_expert
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import names_of
from sarl_core.demonstrations.recoding import recoded
from sarl_core.documents import fitting
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, SarlError, require
from sarl_core.explaining.report.certificates import certificates_part
from sarl_core.explaining.report.comparison import Result, compared
from sarl_core.explaining.report.cover import PLAIN, Cover
from sarl_core.explaining.report.demonstrations import demonstrations_part
from sarl_core.explaining.report.gaps import gaps
from sarl_core.explaining.report.pdf import document_to_pdf
from sarl_core.explaining.report.provenance import (
    commands_that_hold,
    facts,
    how_to_measure,
    mined_again,
)
from sarl_core.explaining.report.rule_set_card import RuleSetCard
from sarl_core.explaining.report.rules import in_order, rules_part
from sarl_core.explaining.report.slides import slides_document
from sarl_core.explaining.report.summary import summary_part
from sarl_core.explaining.report.tally import Tally, report_rules, same_environment, tally
from sarl_core.explaining.report.thresholds import thresholds_part
from sarl_core.explaining.templates import render, whole_percents
from sarl_core.explaining.words.cross_fit import judged_sentence, parting_text
from sarl_core.explaining.words.sign_off import SignOff, sign_off_text
from sarl_core.files import as_path, whole_file
from sarl_core.mining.combining.choice import pairs_chosen_from
from sarl_core.mining.edit_counts import is_plain
from sarl_core.mining.editing.renaming import renamed_rules
from sarl_core.mining.envelope import with_splits
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.language import counted, merged_length, share_text
from sarl_core.mining.never.never_rules import mine_at
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.cross_fitting import cross_fit
from sarl_core.progress import Progress
from sarl_core.rendering.example_frames import (
    EPISODES,
    FIRST_SEED,
    Examples,
    Player,
    try_example_frames,
)
from sarl_core.studies.certificate import Certificate

MOST_IN_FULL = 60
MOST_FRAMES = 12
_MOST_FITTED = 50_000  # steps; to grow ten trees of more takes minutes


@dataclass(frozen=True, eq=False)
class Wishes:
    """What a report is to hold.

    Attributes: As the arguments of `make_report`.
    """

    in_full: int = MOST_IN_FULL
    frames: int = 3
    env_id: EnvironmentOrId = ""
    agent: str | Path | Agent | None = None
    seed: int = FIRST_SEED
    episodes: int = EPISODES
    max_steps: int | None = None
    commands: tuple[str, ...] = ()
    rules_name: str = ""
    demonstrations_name: str = ""
    sign_off: SignOff | None = None
    cover: Cover = PLAIN

    def __post_init__(self) -> None:
        """Refuse what no report can hold.

        Raises:
            InputError: If a number is out of range.
        """
        for name, value, least, most in (
            ("the number of rules in full", self.in_full, 0, 1_000),
            ("the number of pictures a rule", self.frames, 0, MOST_FRAMES),
            ("the number of episodes", self.episodes, 1, 1_000),
            ("max_steps", 1 if self.max_steps is None else self.max_steps, 1, 2**31 - 1),
            ("the seed", self.seed, 0, 2**31 - 1 - self.episodes),
        ):
            require(value, Integral, f"{name} must be a whole number", "give one")
            if not least <= value <= most:
                raise InputError(f"{name} is {value}; give one from {least} to {most:,}")


@dataclass(frozen=True, eq=False)
class Report:
    """A finished report.

    Attributes:
        html: The file's content.
        rules: Number of rules.
        in_full: How many of them are shown in full.
        pictures: Number of example frames.
        without: Why there are none; "" where there are some, or none were wished for.
        notes: How demonstrations, rules and environment were read and matched, as clauses.
        parts: What its template was filled with, by name.
    """

    html: str
    rules: int
    in_full: int
    pictures: int
    without: str
    notes: tuple[str, ...] = ()
    parts: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @cached_property
    def slides(self) -> str:
        """The rules in full as slides, one each: an HTML document that arrow keys go through."""
        return slides_document(self.parts)

    @property
    def pdf(self) -> bytes:
        """The report on paper; a WorkError where no Chromium or Chrome is there to print it."""
        return document_to_pdf(self.html)

    def save(self, path: str | Path) -> None:
        """Write the file; it appears whole or not at all.

        Args:
            path: An `.html` or a `.pdf` file.

        Raises:
            InputError: If it has another ending, or the folder does not exist.
            WorkError: If it cannot be written to, or there is no browser to print a PDF.
        """
        if Path(as_path(path)).suffix.lower() == ".pdf":
            with whole_file(as_path(path)) as unfinished:
                unfinished.write_bytes(self.pdf)
            return
        with whole_file(as_path(path, ending=".html")) as unfinished:
            unfinished.write_text(self.html, encoding="utf-8", newline="\n")

    def save_slides(self, path: str | Path) -> None:
        """Write the slides; they appear whole or not at all.

        Args:
            path: An `.html` file.

        Raises:
            InputError: If it has another ending, or the folder does not exist.
            WorkError: If it cannot be written to.
        """
        with whole_file(as_path(path, ending=".html")) as unfinished:
            unfinished.write_text(self.slides, encoding="utf-8", newline="\n")


def make_report(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    *,
    in_full: int = MOST_IN_FULL,
    frames: int = 3,
    env_id: EnvironmentOrId = "",
    agent: str | Path | Agent | None = None,
    seed: int = FIRST_SEED,
    episodes: int = EPISODES,
    max_steps: int | None = None,
    commands: Sequence[str] = (),
    rules_name: str = "",
    demonstrations_name: str = "",
    sign_off: SignOff | None = None,
    cover: Cover = PLAIN,
    card: Mapping[str, Any] | None = None,
    comparison: Sequence[Result] = (),
    certificates: Sequence[Certificate] = (),
    trees: Sequence[PolicyTree] | None = None,
    progress: Progress | None = None,
) -> Report:
    """Make a report of rules and the demonstrations they are about.

    Args:
        rule_set: The rules.
        demonstrations: N pairs of the same features and actions.
        in_full: So many rules in full, with pictures; the others stand in a table.
        frames: Pictures a rule; 0 for none.
        env_id: Where they are played; "" for the environment of the demonstrations.
        agent: Who plays, as `make_agent` takes it; None for the shipped expert and, where it does
            not come by or there is none, a novice that the rules shield.
        seed: Of the first episode that is played.
        episodes: How many each player plays.
        max_steps: After which one is cut off; 100,000 where None.
        commands: How the rules and the report are made again, one line each.
        rules_name: Of the rule file, "" where there is none.
        demonstrations_name: Of their file, likewise.
        sign_off: Who approved these very rules; None to say nothing of it.
        cover: What a person puts on the first page: title, author, date, notes, who signs, a logo.
        card: Of the rule file, as `read_card` gives it.
        comparison: Results to show.
        certificates: Of these very rules.
        trees: Grown from the demonstrations with the rules' divider; grown here where not given
            and needed.
        progress: Called with (units done, in all) while pictures are made; returning False stops.

    Returns:
        The report; the same arguments give the same one, byte for byte.

    Raises:
        InputError: If a number is out of range, the demonstrations have other features or actions
            than the rules, an agent that was named cannot play, or a certificate is of other rules.
        CancelledError: If `progress` returned False.
    """
    call = "call make_report(rules, demonstrations)"
    require(rule_set, RuleSet, "what a report is about must be a RuleSet", call)
    require(cover, Cover, "the cover of a report must be a Cover", "make one: Cover(title=...)")
    must = "what a report shows the rules on must be Demonstrations"
    require(demonstrations, Demonstrations, must, call)
    wishes = Wishes(
        in_full=in_full,
        frames=frames,
        env_id=env_id,
        agent=agent,
        seed=seed,
        episodes=episodes,
        max_steps=max_steps,
        commands=tuple(commands),
        rules_name=rules_name,
        demonstrations_name=demonstrations_name,
        sign_off=sign_off,
        cover=cover,
    )
    as_given = rule_set
    demonstrations = recoded(demonstrations, rule_set.source.features, called="the demonstrations")
    rule_set, notes = report_rules(rule_set, demonstrations)
    if same_environment(rule_set, demonstrations):
        # A rule file keeps the names of its day; a report speaks as the demonstrations do.
        rule_set = renamed_rules(rule_set, names_of(demonstrations))
    rule_set = with_splits(rule_set, demonstrations)
    counts = tally(rule_set, demonstrations)
    probed = any(rule.origin == "probed" for rule in rule_set.rules)
    if trees is None and rule_set.cut == "thresholds" and not probed:
        trees = grow_policy_trees(
            demonstrations, divider=rule_set.divider, learner=rule_set.learner
        )
    certified = certificates_part(as_given, certificates, card)
    order = in_order(rule_set, wishes.in_full)
    examples, without = _examples(rule_set, demonstrations, order[0], wishes, progress)
    about = demonstrations.env_id or rule_set.source.env_id
    uncovered = gaps(rule_set, demonstrations, counts, examples)
    elsewhere = _elsewhere(as_given, demonstrations, trees, counts)
    entries = fitting(card, RuleSetCard)
    plain_title = f"Rules for {task_name(about)}" if about else "Rules from demonstrations"
    parts: dict[str, Any] = {
        "title": wishes.cover.title.strip() or plain_title,
        "cover": wishes.cover,
        "forbids": rule_set.forbids,
        "decides": counts.decides,
        "summary": summary_part(
            rule_set,
            demonstrations,
            counts,
            results=comparison,
            certified=certified,
            gaps=uncovered,
            elsewhere=elsewhere,
            card=entries,
            sign_off=wishes.sign_off,
        ),
        "key_numbers": _key_numbers(rule_set, counts),
        "sign_off": sign_off_text(wishes.sign_off),
        "approved": wishes.sign_off is not None and bool(wishes.sign_off.approvals),
        "elsewhere": elsewhere,
        "demonstrations": demonstrations_part(rule_set, demonstrations, counts),
        "thresholds": thresholds_part(rule_set, counts, trees, card),
        "rules": rules_part(rule_set, demonstrations, counts, order, examples, entries),
        "pictures": _about_pictures(examples, without, wishes, demonstrations),
        "frame_size": examples.size if examples is not None else (0, 0),
        "gaps": uncovered,
        "compared": compared(comparison),
        "certified": certified,
        "again": facts(
            as_given,
            demonstrations,
            counts,
            rules_name=wishes.rules_name,
            demonstrations_name=wishes.demonstrations_name,
            seeds=(wishes.seed, wishes.seed + wishes.episodes - 1) if examples else None,
            compared=comparison,
            notes=() if same_environment(rule_set, demonstrations) else notes,
        ),
        "to_measure": how_to_measure(
            about,
            measured=any(one.changed is not None for one in comparison),
            certified=bool(certified.verdicts),
        ),
        "commands": commands_that_hold(wishes.commands, as_given, trees),
    }
    return Report(
        html=whole_percents(render("documents/report", **parts)),
        rules=len(rule_set),
        in_full=len(order[0]),
        pictures=sum(len(of_rule) for of_rule in examples.frames.values()) if examples else 0,
        without=without,
        notes=tuple(
            dict.fromkeys((*demonstrations.notes, *notes, *(examples.remarks if examples else ())))
        ),
        parts=parts,
    )


def task_name(env_id: str) -> str:
    """A task's name for people.

    Args:
        env_id: As "LunarLander-v3".

    Returns:
        As "Lunar Lander".
    """
    family = re.sub(r"-v\d+$", "", env_id.rsplit(":", 1)[-1].rsplit("/", 1)[-1])
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", family)


# --- pictures ----------------------------------------------------------------------------------


def _examples(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    rules: Sequence[int],
    wishes: Wishes,
    progress: Progress | None,
) -> tuple[Examples | None, str]:
    """The frames, or why there are none."""
    usable = [index for index in rules if rule_set.rules[index].enabled]
    if not wishes.frames or not usable:
        return None, ""
    env_id = wishes.env_id or demonstrations.env_id or rule_set.source.env_id
    if not env_id:
        return None, "the demonstrations do not say which environment they are from"
    if ":" in str(env_id) and not wishes.env_id:
        # Gymnasium imports the module of "module:Id", and this id is a stranger's.
        return None, f"the environment {env_id!r} names a module to import, which a file may not do"
    players = _players(env_id, wishes)
    examples = try_example_frames(
        env_id,
        rule_set,
        usable,
        players,
        each=wishes.frames,
        episodes=wishes.episodes,
        seed=wishes.seed,
        max_steps=wishes.max_steps,
        progress=progress,
    )
    if not isinstance(examples, SarlError):
        return examples, ""
    if wishes.agent is not None or wishes.env_id:
        raise examples  # who asked for it by name is to know
    return None, str(examples).split(";")[0]


def _players(env_id: EnvironmentOrId, wishes: Wishes) -> tuple[Player, ...]:
    # Sampled, as the shipped demonstrations were: so an agent comes by more states.
    novice = Player("a novice held to the rules", "novice", shielded=True)
    agent = wishes.agent
    if agent is None:
        if not has_expert(env_id):
            return (novice,)
        agent = "expert"
    name = agent.name if isinstance(agent, Agent) else Path(agent).stem
    called = f"the {name}" if name in ("novice", "expert") else f"the agent {name}"
    return Player(called, agent, shielded=False, stochastic=True), novice


def _about_pictures(
    examples: Examples | None, without: str, wishes: Wishes, demonstrations: Demonstrations
) -> tuple[str, ...]:
    if examples is None:
        return (f"There are no pictures of states: {without}.",) if without else ()
    names = [played.player.name for played in examples.played]
    first, last = wishes.seed, wishes.seed + wishes.episodes - 1
    recorded = demonstrations.seed
    elsewhere = (
        ", none of which was demonstrated"
        if recorded is not None
        and (last < recorded or first >= recorded + demonstrations.whole.episodes)
        else ""
    )
    return (
        f"The pictures show states in which the rule applies, from {examples.env_id}. "
        f"{_capital(' and '.join(names))} played {counted(wishes.episodes, 'episode')}"
        f"{' each' if len(names) > 1 else ''} for them (seeds {first} to {last}{elsewhere}). A "
        "rule without pictures came up in none of these episodes.",
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


# --- numbers -----------------------------------------------------------------------------------


def _key_numbers(rule_set: RuleSet, counts: Tally) -> tuple[tuple[str, str], ...]:
    followed = counts.followed
    rules = [rule for rule in rule_set.rules if rule.enabled]
    features = rule_set.source.features
    merged = sum(merged_length(rule, features) for rule in rules) / max(len(rules), 1)
    coverage, right, states = counts.coverage, followed.value, "the demonstrated states"
    if counts.leeway is not None:
        return (
            (f"{len(rules):,}", "rule" if len(rules) == 1 else "rules"),
            (share_text(coverage), f"of {states} have a rule"),
            (share_text(right), "of these are as the rules say"),
            (share_text(counts.leeway.freedom), "of the choice is left (freedom)"),
        )
    if counts.sampled and is_plain(rule_set.rules):
        coverage, right = rule_set.coverage, rule_set.fidelity
    elif counts.sampled:
        states = "a sample of the demonstrated states"
    return (
        (f"{len(rules):,}", "rule" if len(rules) == 1 else "rules"),
        (f"{merged:.1f}", "conditions a rule, on average"),
        (share_text(coverage), f"of {states} have a rule"),
        (share_text(right), "of these show what the rule says"),
    )


def _elsewhere(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    trees: Sequence[PolicyTree] | None,
    counts: Tally,
) -> tuple[str, str]:
    """What the rules are worth where they were not mined, and a warning; "" where not known."""
    if demonstrations.sample_of is not None:
        return "", ""  # episodes that were held out where they were mined stand at each rule
    if not all(rule.enabled for rule in rule_set.rules):
        return "", ""  # whoever mines again mines these too
    if len(demonstrations) > _MOST_FITTED or not mined_again(rule_set, trees):
        return "", ""
    divider = rule_set.divider
    combined = pairs_chosen_from(demonstrations, divider=divider)
    fit = cross_fit(demonstrations, divider=divider, combined=combined, learner=rule_set.learner)
    if counts.leeway is None:
        judged, fidelity = fit.at(rule_set.thresholds), rule_set.fidelity
    else:
        judged = fit.of(lambda of_fold: mine_at(of_fold, rule_set.thresholds))
        fidelity = counts.leeway.fidelity
    return judged_sentence(judged), parting_text(fidelity, judged)
