"""What a report is made of, and the commands that make it again."""

from __future__ import annotations

from dataclasses import dataclass

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.explaining.report.comparison import Result, results_from_text
from sarl_core.explaining.report.cover import Cover, logo_of
from sarl_core.explaining.report.provenance import command_line, mining_command
from sarl_core.explaining.report.report import Wishes
from sarl_core.explaining.report.rule_set_card import read_card
from sarl_core.explaining.report.tally import report_rules
from sarl_core.library.items import PREFIX
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.jobs.report import ReportOrder, as_results, comparison_of_session
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.data import (
    SHIPPED_SETS,
    chosen_dataset,
    raw_demonstrations,
    upload_name,
)
from sarl_dashboard.state.environments import offers
from sarl_dashboard.state.mined import grown_trees
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.rule_files import (
    COMPACT_ENDINGS,
    IN_LIBRARY,
    OWN_FILE,
    compact_file,
    fitting_demonstrations,
)
from sarl_dashboard.state.sign_off import sign_off_here
from sarl_dashboard.views.report.settings import CoverChoices, ReportChoices


@dataclass(frozen=True)
class Named:
    """Files as the command line would name them."""

    rules: str
    demonstrations: str
    results: tuple[str, ...]


def order_of(choices: ReportChoices, demonstrations: Demonstrations) -> ReportOrder:
    """What the choices ask for.

    Args:
        choices: What the widgets say.
        demonstrations: The report is about.

    Raises:
        InputError: If it cannot be had.
    """
    rule_set = rules_for(choices.rules)
    if rule_set is None:
        raise InputError("there are no rules to report; choose some")
    # With what the rules derive; where they are of others, what is wrong is said.
    demonstrations = fitting_demonstrations(rule_set, demonstrations) or demonstrations
    report_rules(rule_set, demonstrations)
    results, files = results_of_choices(choices, demonstrations)
    named = Named(*file_names(choices), files)
    wishes = Wishes(
        in_full=choices.in_full,
        frames=choices.frames,
        env_id=offers().environment(demonstrations.env_id) or "",
        commands=commands(choices, rule_set, demonstrations, named),
        rules_name=named.rules.rsplit("/", 1)[-1],
        demonstrations_name=named.demonstrations.rsplit("/", 1)[-1],
        sign_off=sign_off_here(rule_set),
        cover=cover_of(choices.cover),
    )
    trees = None
    if rule_set.cut == "thresholds":
        trees = grown_trees(demonstrations, rule_set.divider, rule_set.learner)
    # The card of the shipped compact rules says how they came about.
    card = read_card(compact_file(choices.rules)) if choices.rules in COMPACT_ENDINGS else None
    return ReportOrder(rule_set, demonstrations, wishes, card, results, trees)


def cover_of(choices: CoverChoices) -> Cover:
    """What is to stand on the first page.

    Raises:
        InputError: If something does not fit there, or the logo is no picture.
    """
    logo = choices.logo
    return Cover(
        title=choices.title,
        author=choices.author,
        date=choices.date,
        notes=choices.notes,
        signers=choices.signers,
        logo=None if logo is None else logo_of(logo.getvalue(), logo.name),
    )


def results_of_choices(
    choices: ReportChoices, demonstrations: Demonstrations
) -> tuple[tuple[Result, ...], tuple[str, ...]]:
    """The results to show, and the names of their files."""
    results: list[Result] = []
    names: list[str] = []
    if choices.with_session:
        comparison, name = comparison_of_session(demonstrations.env_id)
        results += as_results(comparison)
        names += [name] if name else []
    for file in choices.files:
        content = file.getvalue()
        try:
            results += results_from_text(content.decode("utf-8-sig"), file.name)
        except UnicodeDecodeError as error:
            raise InputError(f"{file.name} is no text; give a CSV or JSON file") from error
        names.append(file.name)
    return tuple(results), tuple(names)


def file_names(choices: ReportChoices) -> tuple[str, str]:
    """Of the rules and of the demonstrations, as the command line would name them."""
    name = chosen_dataset()
    data = f"data/demonstrations/{name}.parquet"
    if name not in SHIPPED_SETS:
        data = upload_name()
    rules = "rules.json"
    if choices.rules in COMPACT_ENDINGS:
        rules = f"data/rules/{compact_file(choices.rules).name}"
    elif choices.rules == IN_LIBRARY:
        rules = f"{PREFIX}{rule_base.base_name()}"
    elif choices.rules == OWN_FILE:
        rules = rule_base.base().name
    return rules, data


def commands(
    choices: ReportChoices, rule_set: RuleSet, demonstrations: Demonstrations, named: Named
) -> tuple[str, ...]:
    """How the report is made again; () where a file alone does not hold what it is made of."""
    raw = raw_demonstrations()
    if raw is None or raw.digest != demonstrations.deriving(raw.derived).digest:
        return ()  # episodes are held out or left out, or things have other names
    mined = None
    if choices.rules not in (*COMPACT_ENDINGS, IN_LIBRARY, OWN_FILE):
        mined = mining_command(
            rule_set, named.rules, named.demonstrations, demonstrations, read=raw
        )
    offered = offers().environment(demonstrations.env_id)
    again = command_line(
        "report",
        named.rules,
        {
            "--demonstrations": named.demonstrations,
            "--comparison": list(named.results),
            "--title": choices.cover.title or None,
            "--author": choices.cover.author or None,
            "--date": choices.cover.date,
            "--logo": None if choices.cover.logo is None else choices.cover.logo.name,
            "--notes": choices.cover.notes or None,
            "--sign-off": list(choices.cover.signers),
            "--in-full": None if choices.in_full == Wishes.in_full else choices.in_full,
            **({} if offered is None else offered.options),
            "--frames": None if choices.frames == Wishes.frames else choices.frames,
            "--out": "report.html",
        },
    )
    return (mined, again) if mined else (again,)
