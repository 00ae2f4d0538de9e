"""Commands that mine rules, and show what thresholds do to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import (
    is_mined_file,
    pairs_of,
    path_of,
    read_demonstrations,
    with_wanted,
)
from sarl_core.cli.options import (
    MINED,
    ClusterAddress,
    Columns,
    Derived,
    Divider,
    EnvOfFile,
    Files,
    Json,
    LearnerName,
    MissingName,
    out_option,
    with_columns,
    with_derived,
    with_environment,
)
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sarl_core.mining.distributed.mined_data import MinedData
    from sarl_core.mining.rules import Thresholds


@with_environment
@with_columns
@with_derived
def mine(
    files: Files,
    out: Annotated[
        Path,
        out_option(
            "The rule file to write; or, with --cluster, a .mined file, from which rules of any "
            "thresholds can be mined again without the steps.",
            metavar="RULES.json",
        ),
    ],
    columns: Columns,
    derived: Derived,
    missing: MissingName = "refuse",
    cluster: ClusterAddress = None,
    support: Annotated[
        float | None,
        typer.Option(
            "--support",
            show_default=False,
            help="Minimum share of the states a rule applies to. For a .mined file: of any rule "
            "that it can give; 0.0001 where not given.",
        ),
    ] = None,
    confidence: Annotated[
        float | None,
        typer.Option(
            "--confidence",
            show_default=False,
            help="Minimum share of those in which the expert did what the rule says.",
        ),
    ] = None,
    never: Annotated[
        float | None,
        typer.Option(
            "--never",
            metavar="EPSILON",
            show_default=False,
            help="Mine rules that forbid: an action that the expert takes in at most this share of "
            "the states of a rule, by its upper 95 % bound, as 0.1. With --confidence or --setting "
            "beside rules that demand one, which then go first.",
        ),
    ] = None,
    setting: Annotated[
        Literal["filtered", "unfiltered"] | None,
        typer.Option(
            "--setting",
            show_default=False,
            help="The paper's two pairs of both: filtered is 0.005 and 0.95, unfiltered 0 and 1.",
        ),
    ] = None,
    env: EnvOfFile = None,
    lift: Annotated[float, typer.Option("--lift", help="Minimum lift.")] = 0.0,
    divider: Divider = 2,
    learner: LearnerName = "auto",
    max_depth: Annotated[
        int | None,
        typer.Option(
            "--max-depth",
            min=0,
            help="Most conditions a rule may have.",
            show_default="no limit",
        ),
    ] = None,
    hold_out: Annotated[
        float | None,
        typer.Option(
            "--hold-out",
            metavar="SHARE",
            show_default=False,
            help="Hold out this share of the episodes, and try every rule on them.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            help="Draws the episodes that are held out, and the parts for --cross-fit.",
            show_default="0",
        ),
    ] = None,
    lower_bound: Annotated[
        float | None,
        typer.Option(
            "--lower-bound",
            metavar="SHARE",
            min=0.0,
            max=1.0,
            show_default=False,
            help="Keep only rules whose 95 % interval of confidence, over the episodes held out, "
            "lies at or above this; with --hold-out. Few episodes can show little: 12 at most "
            "0.87, 30 at most 0.95, even of a rule that is never wrong.",
        ),
    ] = None,
    cross_fit: Annotated[
        bool,
        typer.Option(
            "--cross-fit",
            help="Also say what the rules are worth elsewhere: judge every episode by rules mined "
            "without it.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Mine a rule set and write it to a rule file.

    Example: `python -m sarl_core mine data/demonstrations/lunar_lander.parquet --support 0.005
    --confidence 0.95 --out rules.json`
    """
    given = _RuleOptions(support, confidence, setting, never, lift, max_depth)
    if cluster is not None or any(map(is_mined_file, [out, *files])):
        _mine_at_a_distance(
            files,
            out,
            cluster,
            env,
            columns,
            missing,
            derived,
            given,
            divider=divider,
            hold_out=hold_out,
            seed=seed,
            lower_bound=lower_bound,
            whole="--cross-fit" if cross_fit else "--learner exact" if learner == "exact" else "",
            as_json=as_json,
        )
        return
    seed = seed or 0
    terminal.check_output(out, (".json",))
    given.require_some()
    if lower_bound and hold_out is None:
        raise InputError(
            "--lower-bound asks what episodes say that a rule was not mined from, and none is held "
            "out; give --hold-out as well, as --hold-out 0.2"
        )
    from sarl_core.cli.answers.summaries import (
        describe_oddities,
        describe_rules,
        print_learner,
        print_oddities,
        print_rules,
    )

    with terminal.working("Mining"):
        from sarl_core.cli.answers.evidence import Tried
        from sarl_core.mining.combining.choice import chosen_again
        from sarl_core.mining.envelope import with_boxes
        from sarl_core.mining.growing.growth import grow_policy_trees, learner_for
        from sarl_core.mining.never.never_rules import mine_at
        from sarl_core.mining.validation import cross_fitting, holding_out
        from sarl_core.shielding.leeway import leeway_of

        thresholds = given.thresholds()  # refused before the file is read
        demonstrations = read_demonstrations(files, env, columns, missing)
        demonstrations = with_wanted(demonstrations, derived, divider=divider)
        combined = pairs_of(demonstrations, derived)
        oddities = describe_oddities(demonstrations)
        tried = split = None
        if hold_out is not None:
            split = holding_out.hold_out(demonstrations, hold_out, seed=seed)
            if combined:  # what is held out has no say in what is combined
                mined = chosen_again(split.mined, combined, divider=divider)
                split = split._replace(mined=mined, held_out=split.held_out.deriving(mined.derived))
            demonstrations = split.mined
        chosen = learner_for(learner, len(demonstrations))
        trees = grow_policy_trees(demonstrations, divider=divider, learner=chosen)

        rule_set = with_boxes(mine_at(trees, thresholds), demonstrations)
        judged = None
        if cross_fit:
            fit = cross_fitting.cross_fit(
                demonstrations,
                divider=divider,
                seed=seed,
                combined=combined,
                learner=chosen,
            )
            cut = partial(mine_at, thresholds=thresholds)
            judged = fit.at(thresholds) if never is None else fit.of(cut)
        if split is not None:
            rule_set = holding_out.with_held_out(rule_set, split.held_out)
        short = None
        if lower_bound and split is not None:
            episodes = split.held_out.n_episodes
            short = holding_out.shortfall(rule_set.rules, lower_bound, episodes)
            rule_set = holding_out.with_lower_bound(rule_set, lower_bound)
        if hold_out is not None and split is not None:
            judged_on_them = cross_fitting.judge_pairs(rule_set, split.held_out)
            tried = Tried(hold_out, seed, split.mined.n_episodes, judged_on_them, short)
        leeway = None if never is None else leeway_of(rule_set, demonstrations)
        rule_set.save(out)
    if as_json:
        terminal.print_json(describe_rules(rule_set, out, tried, judged, leeway) | oddities)
    else:
        print_oddities(oddities)
        print_rules(rule_set, out, tried, judged, leeway=leeway)
        print_learner(trees)


class _RuleOptions(NamedTuple):
    """Options that say which rules are mined, None where not given."""

    support: float | None
    confidence: float | None
    setting: str | None
    never: float | None
    lift: float
    max_depth: int | None

    def demands(self) -> bool:
        """Whether rules are to demand an action, too."""
        pair = [self.support is not None, self.confidence is not None]
        return pair == [False, False] if self.setting is not None else pair == [True, True]

    def asks_support(self) -> bool:
        """Whether a minimum support is among them."""
        return self.support is not None or self.setting is not None

    def require_some(self) -> None:
        """Refuse what says nothing whole.

        Raises:
            InputError: If it is neither for rules that demand nor for rules that forbid.
        """
        forbids = self.never is not None and self.confidence is None and self.setting is None
        if not self.demands() and not forbids:
            alone = "" if self.never is None else ", or leave both out for rules that forbid alone"
            raise InputError(
                f"give both --support and --confidence, or --setting instead of them{alone}"
            )
        if forbids and self.lift:
            raise InputError("--lift is for rules that demand an action; leave it out")

    def thresholds(self) -> Thresholds:
        """At which trees are cut.

        Raises:
            InputError: If one is out of range.
        """
        from sarl_core.mining.never.never_rules import never_thresholds
        from sarl_core.mining.rules import NAMED_SETTINGS, Thresholds

        if self.never is not None and not self.demands():
            return never_thresholds(self.never, self.support or 0.0, self.max_depth)
        pair = (self.support or 0.0, self.confidence or 0.0)
        if self.setting is not None:
            pair = (NAMED_SETTINGS[self.setting].support, NAMED_SETTINGS[self.setting].confidence)
        return Thresholds(*pair, self.lift, self.max_depth, self.never)


def _mine_at_a_distance(
    files: list[Path],
    out: Path,
    cluster: str | None,
    env: Environment | None,
    columns: Columns,
    missing: Literal["refuse", "drop"],
    derived: Derived,
    given: _RuleOptions,
    *,
    divider: int,
    hold_out: float | None,
    seed: int | None,
    lower_bound: float | None,
    whole: str,
    as_json: bool,
) -> None:
    """Mine steps that are not here: on a cluster, or from what was left of them."""
    into_mined = is_mined_file(out)
    terminal.check_output(out, (".json", MINED))
    of_mined = any(map(is_mined_file, files))
    if whole:
        raise InputError(
            f"{whole} needs all steps in one memory; leave it out, or mine without a cluster"
        )
    if into_mined and (cluster is None or of_mined):
        raise InputError(
            f"{out}: a {MINED} file is made of steps, on a cluster; give these and --cluster, as "
            "local:2, or write a .json"
        )
    if not into_mined:
        given.require_some()
    if of_mined and (len(files) > 1 or (hold_out, seed, cluster) != (None, None, None)):
        raise InputError(
            f"{files[0]}: what is held out, and where, was settled when it was mined, and the seed "
            "with it; give this file alone, with thresholds"
        )
    if of_mined:
        _require_no_reading(files, env, columns, derived, missing)
    about_rules = {
        "--lower-bound": lower_bound,
        "--max-depth": given.max_depth,
        "--never": given.never,
        "--lift": given.lift or None,
    }
    for option, value in about_rules.items():
        if into_mined and value is not None:
            raise InputError(
                f"{option} is about rules, and a {MINED} file gives those of any; say it when "
                "rules are mined from it"
            )
    if lower_bound and given.never is not None:
        raise InputError(
            "--lower-bound is for rules that demand an action where steps are not in one memory; "
            "leave it out, or leave out --never"
        )
    nobody = "--lower-bound asks what episodes say that a rule was not mined from, and none is held"
    if lower_bound and hold_out is None and not of_mined:
        raise InputError(f"{nobody} out; give --hold-out as well, as --hold-out 0.2")
    from sarl_core.cli.answers.mined import describe_mined, print_mined
    from sarl_core.cli.answers.summaries import (
        describe_rules,
        print_learner,
        print_notes,
        print_rules,
    )

    with terminal.working("Mining") as advance:
        from sarl_core.cli.answers.evidence import Tried
        from sarl_core.mining.distributed.mined_files import load_mined_data, save_mined_data
        from sarl_core.mining.validation import cross_fitting, holding_out
        from sarl_core.shielding.leeway import leeway_of

        thresholds = given.thresholds()  # refused before a file is read
        if cluster is None:
            mined = load_mined_data(files[0])
            if lower_bound and not mined.held_out:
                raise InputError(f"{nobody} out in {files[0]}; leave it out")
            if divider not in (2, mined.divider):
                raise InputError(
                    f"the divider is {divider}, and {files[0]} was mined with {mined.divider}; "
                    "leave it out, or mine the steps again"
                )
        else:
            from sarl_core.mining.distributed.mining import mine_files

            floor = {"min_support": thresholds.support} if given.asks_support() else {}
            mined = mine_files(
                files,
                cluster,
                env_id=env,
                columns=columns,
                missing=missing,
                formulas=derived.formulas,
                pairs_of=partial(pairs_of, derived=derived) if derived.pairs else None,
                divider=divider,
                max_depth=given.max_depth,
                hold_out=hold_out or 0.0,
                seed=seed or 0,
                progress=advance,
                **floor,
            )
        if into_mined:
            save_mined_data(mined, out)
        else:
            if not given.asks_support():
                thresholds = replace(thresholds, support=mined.min_support)
            rule_set = mined.at(thresholds)
            tried = short = leeway = None
            if thresholds.never is not None:
                leeway = leeway_of(rule_set, mined.sample)
            if mined.held_out and mined.counted(thresholds):
                episodes = mined.held_out_episodes
                if lower_bound:
                    short = holding_out.shortfall(rule_set.rules, lower_bound, episodes)
                    rule_set = holding_out.with_lower_bound(rule_set, lower_bound)
                judged = (
                    cross_fitting.judge(rule_set, mined.count_rules(rule_set))
                    if thresholds.never is None
                    else mined.judged(thresholds)  # rules that forbid overlap
                )
                assert judged is not None
                there = rule_set.source.episodes
                tried = Tried(mined.share, mined.seed, there, judged, short)
            rule_set.save(out)
    notes = list(mined.sample.notes)
    elsewhere = "mining the steps again with --hold-out" if of_mined else "--hold-out"
    if given.never is not None:
        notes += _notes_on_forbidding(mined)
        if not mined.counted(thresholds):
            elsewhere = "--cross-fit, where the steps are in one memory,"
    if into_mined:
        document = describe_mined(mined, out)
        terminal.print_json(document) if as_json else print_mined(document)
    elif as_json:
        answer = describe_rules(rule_set, out, tried, leeway=leeway)
        terminal.print_json(answer | {"notes": notes})
    else:
        print_notes(notes)
        print_rules(rule_set, out, tried, elsewhere=elsewhere, leeway=leeway)
        print_learner(mined.trees)


def _notes_on_forbidding(mined: MinedData) -> list[str]:
    """What is not known as it is of rules that demand."""
    notes, steps = [], mined.trees[0].source.steps
    if len(mined.sample) < steps:
        notes.append(
            f"coverage, fidelity and freedom are those of a sample of {len(mined.sample):,} of "
            f"the {steps:,} steps"
        )
    if mined.held_out and any(tree.dimension.n_labels > 2 for tree in mined.trees):
        notes.append(
            "what was counted in held-out episodes is left out: it says nothing of rules that "
            "forbid one of more than two actions; without --never it stands beside each rule"
        )
    return notes


def _require_no_reading(
    files: Sequence[Path],
    env: Environment | None,
    columns: Columns,
    derived: Derived,
    missing: Literal["refuse", "drop"],
) -> None:
    """Refuse what is said of how steps are read, where there are none."""
    if env is not None or columns or derived.pairs or derived.formulas or missing != "refuse":
        raise InputError(
            f"{files[0]}: how its steps are read, and what is derived from them, was settled when "
            "it was mined; leave that out, or mine the steps again"
        )


def _left_out(supports: NDArray[np.float64], least: float, file: Path) -> str:
    """What is said of minimum supports that trees were not grown down to."""
    if supports[-1] < least:
        raise InputError(
            f"{file}: its trees were grown down to a support of {least:g}; begin --supports there "
            "or above, or mine the steps again with a smaller --support"
        )
    return (
        f"minimum supports below {least:g} are left out: the trees were grown down to there, and "
        "rules of fewer states are not known"
    )


@with_environment
@with_columns
@with_derived
def landscape(
    files: Files,
    out: Annotated[Path, out_option("A .json, .csv, .html or .png file.")],
    columns: Columns,
    derived: Derived,
    missing: MissingName = "refuse",
    env: EnvOfFile = None,
    divider: Divider = 2,
    learner: LearnerName = "auto",
    supports: Annotated[
        str,
        typer.Option(
            "--supports",
            metavar="A:B:STEP",
            help="Minimum supports, from A to B.",
        ),
    ] = "0:0.5:0.05",
    confidences: Annotated[
        str | None,
        typer.Option(
            "--confidences",
            metavar="A:B:STEP",
            help="Minimum confidences, from A to B.",
            show_default="0:1:0.05",
        ),
    ] = None,
    never: Annotated[
        str | None,
        typer.Option(
            "--never",
            metavar="A:B:STEP",
            show_default=False,
            help="Of rules that forbid, over epsilons from A to B in the place of confidences, as "
            "0.02:0.4:0.02; with freedom, what they leave to choose.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Rule count, mean length, coverage and fidelity for every pair of thresholds of a grid.

    With --never, those of rules that forbid, and their freedom.

    Example: `python -m sarl_core landscape data/demonstrations/lunar_lander.parquet --out
    landscape.html`
    """
    terminal.check_output(out, (".json", ".csv", ".html", ".png"))
    if never is not None and confidences is not None:
        raise InputError(
            "rules that forbid have an epsilon in the place of a confidence; leave out "
            "--confidences or --never"
        )
    with terminal.working("Drawing the landscape"):
        from sarl_core.explaining.exports.landscape import (
            landscape_document,
            parse_grid,
            save_landscape,
        )
        from sarl_core.mining.growing.growth import grow_policy_trees
        from sarl_core.mining.never.landscape import NeverLandscape, never_landscape
        from sarl_core.mining.never.never_rules import never_thresholds
        from sarl_core.mining.thresholds.landscape import Landscape, threshold_landscape

        rows = parse_grid(supports, "--supports")
        columns_name, across = (
            ("--confidences", confidences or "0:1:0.05") if never is None else ("--never", never)
        )
        grid = rows, parse_grid(across, columns_name)
        if never is not None:  # refuse them before the file is read
            never_thresholds(float(grid[1][0]))
            never_thresholds(float(grid[1][-1]))
        if any(map(is_mined_file, files)):
            from sarl_core.mining.distributed.mined_files import load_mined_data

            if len(files) > 1:
                raise InputError("a file of what is left of steps is read alone; give one")
            _require_no_reading(files, env, columns, derived, missing)
            mined = load_mined_data(files[0])
            trees, notes = mined.trees, mined.notes
            known = rows[rows >= mined.min_support]
            if len(known) < len(rows):
                notes = *notes, _left_out(rows, mined.min_support, files[0])
            grid = known, grid[1]
        else:
            recorded = read_demonstrations(files, env, columns, missing)
            recorded = with_wanted(recorded, derived, divider=divider)
            trees = grow_policy_trees(recorded, divider=divider, learner=learner)
            notes = recorded.notes
        plane: Landscape | NeverLandscape = (
            threshold_landscape(trees, *grid) if never is None else never_landscape(trees, *grid)
        )
        names = [tree.dimension.name for tree in trees]
        source = trees[0].source
        title = f"{source.env_id or path_of(files, short=True)}: {source.steps:,} steps"
        save_landscape(plane, names, out, title=title)
    if as_json:
        terminal.print_json({**landscape_document(plane, names), "notes": list(notes)})
        return
    from sarl_core.cli.answers.summaries import print_learner, print_notes

    cells = f"{plane.rule_count.size:,} cells"
    grown = ", ".join(f"{tree.n_nodes:,}" for tree in trees)
    terminal.print_lines(
        [
            f"Wrote {out}: {cells}, {plane.rule_count.min():,} to {plane.rule_count.max():,} "
            f"rules, from {'a tree' if len(trees) == 1 else 'trees'} of {grown} nodes."
        ]
    )
    print_learner(trees)
    print_notes(notes)
