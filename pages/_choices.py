"""What a visitor may choose on several pages: environment, agents, rules; and what it stands for.

The words on screen are those in the URL.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import _names
import _state as state
import streamlit as st
from _cache import cached
from _environments import registered
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.demonstrations.environments import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.mining.envelope import with_splits
from sarl_core.mining.rule_files import rules_from_json
from sarl_core.mining.rule_names import renamed_rules
from sarl_core.mining.rule_order import fits
from sarl_core.mining.rule_order import rules_for as rules_of
from sarl_core.mining.rules import FILTERED, UNFILTERED, RuleSet
from sarl_core.rollouts.agents import (
    EXPERT_FOLDER,
    Agent,
    PolicyAgent,
    make_agent,
    shipped_experts,
)
from sarl_core.rollouts.seeds import FRESH
from sarl_core.shielding.shield import Projection

AS_DEMONSTRATED = "as demonstrated"
ENVIRONMENTS = (AS_DEMONSTRATED, *(env_id for _, env_id in state.SHIPPED.values()))
OWN_FILE = "own file"
AGENTS = ("novice", "untrained", "expert", OWN_FILE)
CHOSEN, NO_RULES, COMPACT = "at the thresholds", "none", "compact"
EDITED = "edited"
PAPERS = {"filtered": FILTERED, "unfiltered": UNFILTERED}
PROJECTIONS: tuple[Projection, ...] = ("centre", "clip", "expert")
FRESH_SEED = FRESH  # far from those the demonstrations were recorded with
RULES_FOLDER = Path(__file__).parents[1] / "data" / "rules"


def environment_of(choice: str | None) -> str:
    """The environment's id.

    Raises:
        InputError: If the demonstrations do not say theirs, or the dashboard does not take it.
    """
    if choice and choice != AS_DEMONSTRATED:
        return registered(choice)
    demonstrations = state.chosen_demonstrations()
    if demonstrations is None or not demonstrations.env_id:
        raise InputError(
            "the demonstrations do not say which environment they are from; choose "
            "one, or type its id"
        )
    return registered(demonstrations.env_id)


def continuous(choice: str | None) -> bool:
    """Whether the environment takes continuous actions; False where it cannot be used."""
    try:
        return not describe_environment(environment_of(choice)).is_discrete
    except SarlError:
        return False


def demonstrated(env_id: str, seed: int, episodes: int) -> bool:
    """Whether the chosen demonstrations were recorded on some of these seeds."""
    demonstrations = state.chosen_demonstrations()
    return (
        demonstrations is not None
        and demonstrations.seed is not None
        and demonstrations.env_id == env_id
        and demonstrations.seed < seed + episodes
        and seed < demonstrations.seed + demonstrations.n_episodes
    )


def rules_for(choice: str, uploaded: UploadedFile | None) -> tuple[RuleSet | None, str]:
    """The rule set that was chosen, None for none, and what tells it from others.

    Raises:
        InputError: If it cannot be had.
    """
    if choice == NO_RULES:
        return None, ""
    if choice == OWN_FILE:
        if uploaded is None:
            raise InputError("no rule file has been uploaded; upload one, or choose other rules")
        content = uploaded.getvalue()
        return as_named(rules_from_json(content, name=uploaded.name), digest_of(content))
    if choice == COMPACT:
        return compact_rules()
    if choice == EDITED:
        from _edits import edited_rules  # it builds on this module

        return edited_rules()
    demonstrations = state.chosen_demonstrations()
    if demonstrations is None:
        raise InputError(
            "there are no demonstrations to mine rules from; upload some on the "
            "Demonstrations page, or choose a shipped set in the sidebar"
        )
    grown = state.trees(demonstrations, state.chosen_divider())
    rule_set = state.rule_set(grown, PAPERS.get(choice))
    # What was held out is told apart too: the rules carry what it says of them.
    told = (rule_set.source.digest, rule_set.thresholds, rule_set.divider, state.held_out_digest())
    return rule_set, repr(told)


def as_named(rule_set: RuleSet, digest: str) -> tuple[RuleSet, str]:
    """Rules from a file, in the order and under the names of the chosen demonstrations.

    Args:
        rule_set: As it was read.
        digest: Tells it from others.

    Returns:
        The rules, as they were read where they do not fit these; and what tells them from
        others and from themselves under other names or in another order.
    """
    raw = state.raw_demonstrations()
    if raw is None or not fits(rule_set, raw):
        return rule_set, digest
    ordered = rules_of(rule_set, raw).rule_set
    if ordered is not rule_set:
        digest = f"{digest} {raw.digest}"
    names = _names.given_names(raw)
    if names is None:
        return ordered, digest
    return renamed_rules(ordered, names), f"{digest} {_names.digest_of_names(names)}"


def compact_file() -> Path:
    """Where the compact rules of the chosen data lie; there may be none."""
    return RULES_FOLDER / f"{state.chosen_dataset()}_compact.json"


@cached()
def _rule_file(path: Path, stamp: int, dataset: str) -> tuple[RuleSet, str]:
    content = path.read_bytes()
    shipped = rules_from_json(content, name=path.name)
    return with_splits(shipped, state.shipped_demonstrations(dataset)), digest_of(content)


def compact_rules() -> tuple[RuleSet, str]:
    """The compact rules of the chosen data, and what tells them from others.

    Raises:
        InputError: If there are none, or they cannot be read.
    """
    path = compact_file()
    try:
        rule_set, digest = _rule_file(path, path.stat().st_mtime_ns, state.chosen_dataset())
    except OSError as error:
        raise InputError(
            f"there are no compact rules for {state.dataset_label(state.chosen_dataset())}; "
            "choose other rules"
        ) from error
    names = _names.given_names(state.raw_demonstrations())
    if names is None:
        return rule_set, digest
    return renamed_rules(rule_set, names), f"{digest} {_names.digest_of_names(names)}"


def digest_of(content: bytes) -> str:
    """Fingerprint of a file."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _latest_expert() -> int:
    return max((path.stat().st_mtime_ns for path in EXPERT_FOLDER.glob("*.npz")), default=0)


@st.cache_data(max_entries=64, show_spinner=False)
def _expert_digest(env_id: str, stamp: int) -> str:
    path = shipped_experts().get(env_id)
    return digest_of(path.read_bytes()) if path is not None else ""


def named_agent(choice: str, env_id: str) -> str:
    """What tells an agent of a known name from others, by content.

    Args:
        choice: One of `AGENTS`, not a file.
        env_id: Environment.
    """
    return f"{choice} {_expert_digest(env_id, _latest_expert()) if choice == 'expert' else ''}"


def has_expert(env_id: str) -> bool:
    """Whether an expert is shipped for an environment."""
    return bool(_expert_digest(env_id, _latest_expert()))


@dataclass(frozen=True)
class PolicyFile:
    """A policy that a visitor uploaded, and the statistics of its observations, if it has any."""

    policy: UploadedFile
    statistics: UploadedFile | None = None

    @property
    def name(self) -> str:
        """As the visitor knows it."""
        return self.policy.name


def policy_upload(label: str, key: str, env: str | None) -> PolicyFile | None:
    """Ask for a policy, and for the statistics that belong to it; say what looks odd in them."""
    policy = st.file_uploader(f"{label}: .npz, or a Stable-Baselines3 .zip", key=key)
    if policy is None:
        return None
    statistics = None
    if policy.name.lower().endswith(".zip"):
        statistics = st.file_uploader(
            "Statistics of its observations (.pkl)",
            key=f"{key}_statistics",
            help="Of a policy that was trained under VecNormalize: what VecNormalize.save() wrote.",
        )
    found = PolicyFile(policy, statistics)
    say_notes(found, env)
    return found


def policy_uploads(label: str, key: str, env: str | None) -> list[PolicyFile]:
    """Ask for policies; statistics (.pkl) among the files go to the .zip whose name they have."""
    files = st.file_uploader(
        f"{label}: .npz, or Stable-Baselines3 .zip (with NAME_vecnormalize.pkl, if NAME.zip was "
        "trained under VecNormalize)",
        accept_multiple_files=True,
        key=key,
    )
    statistics = [file for file in files if file.name.lower().endswith(".pkl")]
    policies = [file for file in files if file not in statistics]
    zips = [file for file in policies if file.name.lower().endswith(".zip")]

    def of(policy: UploadedFile) -> UploadedFile | None:
        if policy not in zips:
            return None
        if len(zips) == len(statistics) == 1:
            return statistics[0]
        stem = Path(policy.name).stem
        names = (f"{stem}_vecnormalize.pkl", f"{stem}_vec_normalize.pkl")
        return next((file for file in statistics if file.name in names), None)

    found = [PolicyFile(policy, of(policy)) for policy in policies]
    used = [file.statistics for file in found]
    for file in statistics:
        if file not in used:
            st.warning(
                f"{file.name} was not used: call it NAME_vecnormalize.pkl if it belongs to NAME.zip"
            )
    for policy in found:
        say_notes(policy, env)
    return found


def say_notes(file: PolicyFile, env: str | None) -> None:
    """Say on the page how a policy was read, and what looks odd in it."""
    try:
        env_id = environment_of(env)
        make, digest = agent_for(OWN_FILE, file, env_id, 0)
        notes = _notes(digest, env_id, make)
    except SarlError:
        return  # the page says so where the policy is used
    for note in notes:
        st.warning(f"{note}.")


@st.cache_data(max_entries=16, show_spinner=False)
def _notes(digest: str, env_id: str, _make: Callable[[], Agent]) -> tuple[str, ...]:
    agent = _make()
    return agent.notes if isinstance(agent, PolicyAgent) else ()


def agent_for(
    choice: str, uploaded: PolicyFile | None, env_id: str, seed: int
) -> tuple[Callable[[], Agent], str]:
    """How to make the agent, and what tells it from others of its name.

    Raises:
        InputError: If there is no such agent.
    """
    if choice != OWN_FILE:
        return lambda: make_agent(choice, env_id, seed=seed), named_agent(choice, env_id)
    if uploaded is None:
        raise InputError("no policy has been uploaded; upload one, or choose another agent")
    files = [file for file in (uploaded.policy, uploaded.statistics) if file is not None]
    contents = [file.getvalue() for file in files]

    def make() -> Agent:
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder) / Path(file.name).name for file in files]
            for path, content in zip(paths, contents, strict=True):
                path.write_bytes(content)
            try:
                agent = make_agent(
                    paths[0], env_id, seed=seed, normalise=next(iter(paths[1:]), None)
                )
            except SarlError as error:
                # The folder is ours; the person knows the file by its name.
                raise InputError(str(error).replace(f"{folder}/", "")) from error
            if not isinstance(agent, PolicyAgent):
                return agent
            return replace(
                agent, notes=tuple(note.replace(f"{folder}/", "") for note in agent.notes)
            )

    return make, " ".join(digest_of(content) for content in contents)
