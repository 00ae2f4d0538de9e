"""The command that finds out where demonstrations are missing, and asks for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import (
    pairs_of,
    read_agent,
    read_demonstrations,
    typed_again,
    workers_at,
)
from sarl_core.cli.options import (
    AgentName,
    ChoiceName,
    ClusterAddress,
    Columns,
    Derived,
    Divider,
    EnvOfFile,
    Files,
    Json,
    MaxSteps,
    MissingName,
    Normalise,
    ProjectionName,
    ReportEpisodes,
    Seed,
    out_option,
    with_columns,
    with_derived,
    with_played_environment,
)
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from sarl_core.agents.agent import Agent
    from sarl_core.demonstrations.dataset import Demonstrations
    from sarl_core.environments.environment import EnvironmentOrId
    from sarl_core.improving.aggregation import Aggregation
    from sarl_core.improving.gaps import Gaps
    from sarl_core.improving.plan import Plan
    from sarl_core.mining.rules import Thresholds

_NOBODY = "none"


@with_played_environment
@with_columns
@with_derived
def aggregate(
    context: typer.Context,
    files: Files,
    out: Annotated[
        Path,
        out_option(
            "The rule file (.json) to write, its card beside it; with --expert none, the "
            "states that need a demonstration (.csv)."
        ),
    ],
    columns: Columns,
    derived: Derived,
    missing: MissingName = "refuse",
    max_rules: Annotated[
        int, typer.Option("--max-rules", help="Most rules of each action dimension.")
    ] = 48,
    env: EnvOfFile = None,
    agent: AgentName = "novice",
    expert: Annotated[
        str,
        typer.Option(
            "--expert",
            metavar="AGENT",
            help="Who is asked: expert (the shipped one), the path of a trained policy, "
            "module:name as of --agent, or none.",
        ),
    ] = "expert",
    normalise: Normalise = None,
    first_rules: Annotated[
        Path | None,
        typer.Option(
            "--first-rules",
            metavar="RULES.json",
            show_default=False,
            help="The rules of the first round, as this command wrote them: a search is gone on "
            "with, or rules that a person has changed are searched around. Of more of them than "
            "--max-rules a refinement (--rounds 1 --refine N) first leaves out one after another. "
            "Give another --seed than made them: the same one plays the same episodes.",
        ),
    ] = None,
    rounds: Annotated[
        int, typer.Option("--rounds", help="How often the rules act and the expert answers.")
    ] = 20,
    episodes: Annotated[int, typer.Option("--episodes", help="Episodes a round.")] = 40,
    support: Annotated[
        float | None,
        typer.Option(
            "--support",
            help="With --confidence: cut the trees at these thresholds.",
            show_default="every leaf is a rule",
        ),
    ] = None,
    confidence: Annotated[
        float | None, typer.Option("--confidence", help="See --support.", show_default=False)
    ] = None,
    divider: Divider = 2,
    projection: ProjectionName = "centre",
    refine: Annotated[
        int,
        typer.Option(
            "--refine",
            help="Turns of changing conditions and labels, and moving thresholds, to where they "
            "achieve more; 0 for none.",
        ),
    ] = 0,
    search_episodes: Annotated[
        int | None,
        typer.Option(
            "--search-episodes",
            help="With --refine: episodes for each neighbour that is tried, at most 1,000; take "
            "fewer where an episode takes long.",
            show_default="16",
        ),
    ] = None,
    search_limit: Annotated[
        int | None,
        typer.Option(
            "--search-limit",
            metavar="STEPS",
            help="With --refine: the time limit of the search's episodes, in place of the "
            "environment's own. A longer one tells apart what would fail later, where all that is "
            "tried reaches the limit; a shorter one leaves time for more episodes, where their "
            "beginning shows how the rest will be.",
            show_default="the environment's own",
        ),
    ] = None,
    search_starts: Annotated[
        int | None,
        typer.Option(
            "--search-starts",
            help="With --refine: move the rules of so many of the best rounds a little, the better "
            "half on, and so forth, before the best of them is gone on with. Few rules of one "
            "feature gain most by more.",
            show_default="an eighth of the rounds, 4 at least",
        ),
    ] = None,
    search_steps: Annotated[
        int,
        typer.Option(
            "--search-steps",
            help="With --refine: change the rules in so many steps a turn by what their own "
            "episodes say of each label, in place of what the expert says. Weak rules come further "
            "so in as many episodes; 8 is a good number.",
        ),
    ] = 0,
    search_generations: Annotated[
        int | None,
        typer.Option(
            "--search-generations",
            help="With --refine: in how many generations of 20 neighbours the thresholds of the "
            "best rules are moved in each turn. Each neighbour plays twice the search episodes, so "
            "that a hundred generations take long; of more than 16 each leaves its worse half "
            "after a third of them, and half of the rest after two thirds.",
            show_default="16",
        ),
    ] = None,
    search_worth: Annotated[
        float | None,
        typer.Option(
            "--search-worth",
            help="With --refine: what a failure counts in the search, in units of the return. A "
            "failure that is rare and counts much hides what else is better in a few episodes.",
            show_default="as much as the returns of the rounds differ, with --choose failures",
        ),
    ] = None,
    validation: Annotated[
        int, typer.Option("--validation", help="Episodes by which the best is chosen.")
    ] = 256,
    report: ReportEpisodes = 100,
    choose: ChoiceName = "return",
    seed: Seed = 0,
    max_steps: MaxSteps = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes.")] = 1,
    cluster: ClusterAddress = None,
    as_json: Json = False,
) -> None:
    """Ask the expert where the rules lead, and mine few rules that do as much as possible.

    Each round the rules shield the agent, the expert says what it would have done in the states
    they lead to, and rules are mined again from all answers, at most so many for each action
    dimension. The best round is found on episodes of its own and reported on others.

    Example: `python -m sarl_core aggregate data/demonstrations/cartpole.parquet --max-rules 4
    --rounds 5 --out compact.json`
    """
    nobody = expert == _NOBODY
    terminal.check_output(out, (".csv",) if nobody else (".json",))
    with terminal.working("Starting"):
        from sarl_core.demonstrations.dataset import with_formulas
        from sarl_core.demonstrations.names import in_order_of
        from sarl_core.environments.description import describe_environment
        from sarl_core.improving.aggregation import recorded_environment
        from sarl_core.improving.plan import Plan
        from sarl_core.mining.rule_set import load_rules

        searches = {
            "episodes": search_episodes,
            "limit": search_limit,
            "starts": search_starts,
            "steps": search_steps or None,
            "generations": search_generations,
            "worth": search_worth,
        }
        for name, given in searches.items():
            if given is not None and not refine:
                raise InputError(f"--search-{name} is about a refinement; give --refine, too")
        if nobody and first_rules is not None:
            raise InputError("--first-rules are those of a first round; name an expert, too")
        plan = Plan(
            max_rules=max_rules,
            rounds=rounds,
            episodes=episodes,
            thresholds=_thresholds(support, confidence),
            divider=divider,
            projection=projection,
            turns=refine,
            search_episodes=Plan.search_episodes if search_episodes is None else search_episodes,
            search_limit=search_limit,
            search_starts=search_starts,
            search_steps=search_steps,
            search_generations=search_generations,
            search_worth=search_worth,
            validation=validation,
            report=report,
            seed=seed,
            max_steps=max_steps,
            choose=choose,
        )
        first = None if first_rules is None else load_rules(first_rules)
        start = read_demonstrations(files, env, columns, missing)
        environment = env or recorded_environment(start)
        agents = _agents(agent, expert, environment, normalise)
        read = start.notes
        start, notes = in_order_of(start, describe_environment(environment))
        notes = tuple(dict.fromkeys((*read, *notes)))
        start = with_formulas(start, derived.formulas)
        plan = replace(plan, combined=pairs_of(start, derived))
    if nobody:
        with workers_at(cluster) as executor:
            _gaps(start, plan, environment, agents[0], out, jobs, executor, as_json, notes)
        return
    with workers_at(cluster) as executor, terminal.working("Asking the expert") as advance:
        from sarl_core.improving.aggregation import aggregate as run
        from sarl_core.improving.aggregation_files import save_aggregation

        aggregation = run(
            start,
            plan,
            env_id=environment,
            agent=agents[0],
            expert=agents[1],
            first_rules=first,
            jobs=jobs,
            executor=executor,
            progress=advance,
        )
    written, card = save_aggregation(aggregation, out, command=typed_again(context))
    if not aggregation.is_finished:
        left = _what_is_left(aggregation, written, out)
        if aggregation.fault:
            raise InputError(f"{aggregation.fault}; {left}")
        raise terminal.StoppedError(left)
    notes = tuple(dict.fromkeys((*notes, *aggregation.remarks)))
    if as_json:
        terminal.print_json({**card, "notes": list(notes)})
        return
    from sarl_core.mining.language import share_text

    known = any(one.failures is not None for one in aggregation.rounds)
    terminal.print_table(
        (
            *("Round", "Demonstrations", "Rules", "Mean return"),
            *(["Failures"] if known else []),
            *("Coverage", "Expert disagrees"),
        ),
        [
            (
                str(one.number),
                f"{one.pairs:,}",
                str(one.rules),
                f"{one.mean_return:.1f}",
                *([] if one.failures is None else [f"{one.failures.count} of {one.failures.of}"]),
                share_text(one.coverage, decimals=1),
                share_text(one.disagreement, decimals=1),
            )
            for one in aggregation.rounds
        ],
    )
    reported = card["reported"]
    terminal.print_lines(
        [
            f"Wrote {out}: {card['rules']} rules of round {aggregation.chosen}"
            f"{', refined' if aggregation.refined else ''}"
            f"{f', {aggregation.left_out} left out' if aggregation.left_out else ''}.",
            f"Mean return {reported['mean']:.1f} over {reported['episodes']} episodes used for "
            f"nothing else (deviation {reported['std']:.1f}, least {reported['min']:.1f}).",
            *_beside(reported, card["env_id"]),
            f"Chosen by {card['chosen_by']}.",
            *(f"note: {note}" for note in notes),
        ]
    )


def _beside(reported: dict[str, Any], env_id: str) -> list[str]:
    """How often these episodes failed, and what the rules left to choose from."""
    from sarl_core.rollouts.failures import safety_facts

    facts = safety_facts(reported, reported["episodes"], env_id, shielded=True)
    return [f"{what[0].upper()}{what[1:]}: {text}." for what, text in facts]


def _agents(
    agent: str, expert: str, env_id: EnvironmentOrId, normalise: str | None
) -> tuple[Agent, Agent | str]:
    """Who is shielded and who is asked; `normalise` is of the one that is a .zip."""
    zipped = [name.lower().endswith(".zip") for name in (agent, expert)]
    if normalise is not None and all(zipped):
        raise InputError(
            "--normalise is of one .zip, and both agent and expert are one; leave it out, and lay "
            "the statistics of each beside it, as NAME_vecnormalize.pkl"
        )
    return (
        read_agent(agent, env_id, None if zipped[1] else normalise),
        expert
        if expert == _NOBODY
        else read_agent(expert, env_id, normalise if zipped[1] else None),
    )


def _what_is_left(aggregation: Aggregation, written: Path, out: Path) -> str:
    """In one line, what a stopped run leaves behind."""
    from sarl_core.improving.aggregation_files import chosen_by

    beside = "" if written == out else f" ({out} stays as it was)"
    return (
        f"stopped after {len(aggregation.rounds)} of {aggregation.plan.rounds} rounds; the best "
        f"rules so far are in {written}{beside}, chosen by {chosen_by(aggregation)}; no "
        "fresh episode has tried them"
    )


def _thresholds(support: float | None, confidence: float | None) -> Thresholds | None:
    from sarl_core.mining.rules import Thresholds

    if support is None and confidence is None:
        return None
    if support is None or confidence is None:
        raise InputError("--support and --confidence belong together; give both or neither")
    return Thresholds(support, confidence)


def _gaps(
    start: Demonstrations,
    plan: Plan,
    env_id: EnvironmentOrId,
    agent: Agent,
    out: Path,
    jobs: int,
    executor: Executor | None,
    as_json: bool,
    notes: tuple[str, ...],
) -> None:
    """Without an expert: which states need a demonstration."""
    if plan.thresholds is None:
        raise InputError(
            "without thresholds every state is covered; give --support and --confidence"
        )
    gaps: Gaps | None = None
    with terminal.working("Looking for gaps") as advance:
        from sarl_core.environments.failures import failure_known
        from sarl_core.improving.gaps import gaps_so_far
        from sarl_core.mining.algorithm_1 import mine_rules
        from sarl_core.rollouts.episodes import MAX_STEPS, cut_text

        at = plan.thresholds
        if plan.combined:
            from sarl_core.mining.combining.choice import with_combinations

            start = with_combinations(start, pairs=plan.combined, divider=plan.divider)
        rules = mine_rules(start, supp_min=at.support, conf_min=at.confidence, divider=plan.divider)
        try:
            for so_far in gaps_so_far(
                env_id,
                rules,
                agent=agent,
                episodes=plan.episodes,
                seed=plan.seed,
                projection=plan.projection,
                jobs=jobs,
                executor=executor,
                max_steps=plan.max_steps,
                progress=advance,
            ):
                gaps = so_far
        except KeyboardInterrupt:
            if gaps is None:
                raise
    assert gaps is not None
    if gaps.episodes < plan.episodes:
        raise terminal.StoppedError(_keep_gaps(gaps, out, plan.episodes))
    _write_gaps(gaps, out)
    if gaps.cut:
        steps = plan.max_steps or MAX_STEPS
        notes = (*notes, cut_text(gaps.cut, gaps.episodes, steps, may_fail=failure_known(env_id)))
    notes = tuple(dict.fromkeys((*notes, *gaps.notes)))
    document: dict[str, Any] = {
        "file": str(out),
        "rules": len(rules),
        "met": gaps.met,
        "without_a_rule": len(gaps),
        "share": gaps.share,
        "notes": list(notes),
    }
    if as_json:
        terminal.print_json(document)
        return
    from sarl_core.mining.language import share_text

    terminal.print_lines(
        [
            f"Wrote {out}: {len(gaps):,} of {gaps.met:,} states that were met "
            f"({share_text(gaps.share, decimals=1)}) have no rule and need a demonstration.",
            *(f"note: {note}" for note in notes),
        ]
    )


def _write_gaps(gaps: Gaps, path: Path) -> None:
    from sarl_core.files import whole_file

    with whole_file(path) as unfinished:
        gaps.to_frame().to_csv(unfinished, index=False)


def _keep_gaps(gaps: Gaps, out: Path, planned: int) -> str:
    """Write what a stopped search has found, and say so in one line."""
    from sarl_core.improving.aggregation_files import stopped_path

    written = stopped_path(out)
    _write_gaps(gaps, written)
    beside = "" if written == out else f" ({out} stays as it was)"
    return (
        f"stopped after {gaps.episodes} of {planned} episodes; the {len(gaps):,} "
        f"states without a rule that they met are in {written}{beside}"
    )
