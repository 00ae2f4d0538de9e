"""The command line: one thin function a command (DESIGN section 5).

What is heavy is imported where it is used, so that ``--help`` answers at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sarl_core.commandline import terminal
from sarl_core.commandline.options import (
    AgentName,
    Divider,
    Env,
    EnvOfFile,
    File,
    Json,
    ProjectionName,
    Rules,
    Seed,
    Stochastic,
)
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.demonstrations.dataset import Demonstrations
    from sarl_core.shielding.shield import Shield

app = typer.Typer(
    name="sarl_core",
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    help="Readable safety rules from expert demonstrations, and a shield made of them.",
)


def main(arguments: Sequence[str]) -> int:
    """Run the command line.

    Args:
        arguments: Without the program's name.

    Returns:
        The exit code.
    """
    return terminal.run(app, arguments)


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    debug: Annotated[
        bool,
        typer.Option(
            "--debug",
            help="After an error, show where it came from. Also after a command.",
        ),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        terminal.print_lines([context.get_help()])


@app.command()
def record(
    env: Env,
    agent: AgentName,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            show_default=False,
            help="A .parquet, .csv or .npz file.",
        ),
    ],
    steps: Annotated[int, typer.Option("--steps", min=1, help="How many to record.")] = 15_000,
    seed: Seed = 0,
    stochastic: Stochastic = False,
    as_json: Json = False,
) -> None:
    """Run an agent and save what it saw and did as demonstrations.

    Example: `python -m sarl_core record --env CartPole-v1 --agent expert --stochastic --steps 5000
    --out cartpole.parquet`
    """
    terminal.check_output(out, (".parquet", ".csv", ".npz"))
    with terminal.working("Recording") as advance:
        from sarl_core.demonstrations.formats import save_demonstrations
        from sarl_core.rollouts.recording import record as record_demonstrations

        demonstrations = record_demonstrations(
            env, agent, steps=steps, seed=seed, stochastic=stochastic, progress=advance
        )
        save_demonstrations(demonstrations, out)
    _tell_demonstrations(demonstrations, out, as_json)


@app.command()
def check(file: File, env: EnvOfFile = None, as_json: Json = False) -> None:
    """Read and check demonstrations, and print what is in them.

    Example: `python -m sarl_core check data/demonstrations/lunar_lander.parquet`
    """
    _tell_demonstrations(_load(file, env), file, as_json)


@app.command()
def mine(
    file: File,
    support: Annotated[
        float,
        typer.Option(
            "--support",
            show_default=False,
            help="Minimum share of the states a rule applies to.",
        ),
    ],
    confidence: Annotated[
        float,
        typer.Option(
            "--confidence",
            show_default=False,
            help="Minimum share of those in which the expert did what the rule says.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="RULES.json",
            show_default=False,
            help="The rule file to write.",
        ),
    ],
    env: EnvOfFile = None,
    lift: Annotated[float, typer.Option("--lift", help="Minimum lift.")] = 0.0,
    divider: Divider = 2,
    max_depth: Annotated[
        int | None,
        typer.Option(
            "--max-depth",
            min=0,
            help="Most conditions a rule may have.",
            show_default="no limit",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Mine a rule set and write it to a rule file.

    Example: `python -m sarl_core mine data/demonstrations/lunar_lander.parquet --support 0.005
    --confidence 0.95 --out rules.json`
    """
    terminal.check_output(out, (".json",))
    with terminal.working("Mining"):
        from sarl_core.mining.rules import Thresholds, mine_rules

        Thresholds(support, confidence, lift, max_depth)  # refuse them before the file is read
        rule_set = mine_rules(
            _load(file, env),
            supp_min=support,
            conf_min=confidence,
            lift_min=lift,
            max_depth=max_depth,
            divider=divider,
        )
        rule_set.save(out)
    from sarl_core.commandline.answers import describe_rules, print_rules

    if as_json:
        terminal.print_json(describe_rules(rule_set, out))
    else:
        print_rules(rule_set, out)


@app.command()
def landscape(
    file: File,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            show_default=False,
            help="A .json, .csv, .html or .png file.",
        ),
    ],
    env: EnvOfFile = None,
    divider: Divider = 2,
    supports: Annotated[
        str,
        typer.Option(
            "--supports",
            metavar="A:B:STEP",
            help="Minimum supports, from A to B.",
        ),
    ] = "0:0.5:0.05",
    confidences: Annotated[
        str,
        typer.Option(
            "--confidences",
            metavar="A:B:STEP",
            help="Minimum confidences, from A to B.",
        ),
    ] = "0:1:0.05",
    as_json: Json = False,
) -> None:
    """Rule count, mean length, coverage and fidelity for every pair of thresholds of a grid.

    Example: `python -m sarl_core landscape data/demonstrations/lunar_lander.parquet --out
    landscape.html`
    """
    terminal.check_output(out, (".json", ".csv", ".html", ".png"))
    with terminal.working("Drawing the landscape"):
        from sarl_core.explaining.landscape_files import (
            landscape_document,
            parse_grid,
            save_landscape,
        )
        from sarl_core.mining.landscape import threshold_landscape
        from sarl_core.mining.tree import grow_policy_trees

        grid = parse_grid(supports, "--supports"), parse_grid(confidences, "--confidences")
        trees = grow_policy_trees(_load(file, env), divider=divider)
        found = threshold_landscape(trees, *grid)
        names = [tree.dimension.name for tree in trees]
        source = trees[0].source
        title = f"{source.env_id or file.name}: {source.steps:,} steps"
        save_landscape(found, names, out, title=title)
    if as_json:
        terminal.print_json(landscape_document(found, names))
        return
    cells = f"{found.rule_count.size:,} cells"
    grown = ", ".join(f"{tree.n_nodes:,}" for tree in trees)
    terminal.print_lines(
        [
            f"Wrote {out}: {cells}, {found.rule_count.min():,} to {found.rule_count.max():,} "
            f"rules, from {'a tree' if len(trees) == 1 else 'trees'} of {grown} nodes."
        ]
    )


@app.command()
def evaluate(
    env: Env,
    agent: AgentName,
    rules: Rules = None,
    episodes: Annotated[int, typer.Option("--episodes", min=1, help="How many.")] = 10,
    seed: Annotated[
        int,
        typer.Option(
            "--seed",
            min=0,
            help="Episode i uses this seed + i.",
        ),
    ] = 0,
    stochastic: Stochastic = False,
    projection: ProjectionName = "centre",
    as_json: Json = False,
) -> None:
    """Run episodes, shielded or not: returns, lengths, interventions, coverage.

    Example: `python -m sarl_core evaluate --env LunarLander-v3 --agent novice --rules rules.json
    --episodes 50 --seed 1 --json`
    """
    with terminal.working("Running episodes") as advance:
        from sarl_core.rollouts.episodes import rollout

        found = rollout(
            env,
            agent,
            shield=_shield(rules, projection),
            episodes=episodes,
            seed=seed,
            stochastic=stochastic,
            keep_steps=False,
            progress=advance,
        )
        document = found.to_dict()
    if as_json:
        terminal.print_json(document)
        return
    from sarl_core.commandline.answers import print_episodes

    shielded = "unshielded" if rules is None else f"shielded by {rules}"
    print_episodes(document, f"{found.agent} in {env}, {shielded}")


@app.command()
def render(
    env: Env,
    agent: AgentName,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            show_default=False,
            help="A .gif or .mp4 file.",
        ),
    ],
    rules: Rules = None,
    seed: Seed = 0,
    both: Annotated[
        bool,
        typer.Option(
            "--side-by-side",
            help="With the shield and without it, on the same seed.",
        ),
    ] = False,
    stochastic: Stochastic = False,
    projection: ProjectionName = "centre",
    as_json: Json = False,
) -> None:
    """Play one episode and save it as a moving picture, in real time.

    Example: `python -m sarl_core render --env LunarLander-v3 --agent novice --rules rules.json
    --seed 1 --side-by-side --out replay.gif`
    """
    terminal.check_output(out, (".gif", ".mp4"))
    shield = _shield(rules, projection)
    if both and shield is None:
        raise InputError("--side-by-side compares with a shield; give --rules, or leave it out")
    with terminal.working("Playing") as advance:
        from sarl_core.rollouts.rendering import render_episode, side_by_side

        if both and shield is not None:
            replay = side_by_side(
                env, agent, shield, seed=seed, stochastic=stochastic, progress=advance
            )
        else:
            replay = render_episode(
                env, agent, shield=shield, seed=seed, stochastic=stochastic, progress=advance
            )
    with terminal.working("Writing") as advance:
        replay.save(out, progress=advance)
    from sarl_core.commandline.answers import describe_replay, print_replay

    document = describe_replay(replay, out, [shield is not None, False])
    if as_json:
        terminal.print_json(document)
    else:
        print_replay(document)


@app.command("train-expert")
def train_expert(
    env: Env,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE.npz",
            show_default=False,
            help="The policy to write; its card stands beside it as .json.",
        ),
    ],
    seed: Seed = 0,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps",
            min=1,
            help="Environment steps.",
            show_default="the recipe's",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Train an expert as the shipped ones were, and write its weights and its card.

    Example: `python -m sarl_core train-expert --env CartPole-v1 --seed 0 --out expert.npz`
    """
    terminal.check_output(out, (".npz",))
    with terminal.working("Training") as advance:
        from sarl_core.rollouts.training import train_expert as train

        card = train(
            env,
            out=out,
            seed=seed,
            steps=steps,
            progress=lambda done, total, _: advance(done, total),
        )
    if as_json:
        terminal.print_json(card)
        return
    returns = card["returns_deterministic"]
    terminal.print_lines(
        [
            f"Wrote {out}: mean return {returns['mean']:.1f} over {returns['episodes']} episodes "
            f"({returns['min']:.1f} to {returns['max']:.1f}), after "
            f"{card['kept_after_steps']:,} steps."
        ]
    )


def _tell_demonstrations(demonstrations: Demonstrations, path: Path, as_json: bool) -> None:
    from sarl_core.commandline.answers import describe_demonstrations, print_demonstrations

    document = describe_demonstrations(demonstrations, path)
    if as_json:
        terminal.print_json(document)
    else:
        print_demonstrations(document)


def _load(file: Path, env_id: str | None) -> Demonstrations:
    from sarl_core.demonstrations.formats import load_demonstrations

    return load_demonstrations(file, env_id=env_id)


def _shield(rules: Path | None, projection: Literal["centre", "clip", "expert"]) -> Shield | None:
    if rules is None:
        return None
    from sarl_core.mining.rules import RuleSet
    from sarl_core.shielding.shield import Shield

    return Shield(RuleSet.load(rules), projection=projection)
