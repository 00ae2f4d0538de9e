"""What a visitor may choose on several pages: environment, agents, rules; and what it stands for.

The words on screen are those in the URL.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.agents import agent as library
from sarl_core.agents.agent import EXPERT_FOLDER, Agent, PolicyAgent, shipped_experts
from sarl_core.agents.own import OwnAgent, own_agent
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, SarlError, quoted
from sarl_core.rollouts.seeds import FRESH
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Projection
from sarl_dashboard.cache import cached
from sarl_dashboard.state.environments import environment_of, offers
from sarl_dashboard.state.rule_files import OWN_FILE
from sarl_dashboard.text import digest_of

AGENTS = ("novice", "untrained", "expert")
PROJECTIONS: tuple[Projection, ...] = ("centre", "clip", "expert")
FRESH_SEED = FRESH  # far from those the demonstrations were recorded with


def own_agents() -> dict[str, str]:
    """Agents of whoever runs the server: ``module:name`` by the name on screen."""
    return dict(offers().agents)


def offered_agents() -> tuple[str, ...]:
    """Whom a visitor may choose: the usual ones, those of whoever runs the server, an own file."""
    return (*AGENTS, *own_agents(), OWN_FILE)


def _latest_expert() -> int:
    return max((path.stat().st_mtime_ns for path in EXPERT_FOLDER.glob("*.npz")), default=0)


@cached()
def _expert_digest(env_id: str, stamp: int) -> str:
    path = shipped_experts().get(env_id)
    if path is None:
        return "scripted" if library.has_expert(env_id) else ""
    return digest_of(path.read_bytes())


def has_expert(env_id: EnvironmentOrId) -> bool:
    """Whether an expert is shipped for an environment."""
    return bool(_expert_digest(str(env_id), _latest_expert()))


@dataclass(frozen=True)
class ChosenAgent:
    """An agent that was chosen, which a call makes.

    Attributes:
        choice: One of `offered_agents`.
        env_id: Environment.
        seed: Of what is random in it.
        files: Names and contents of the policy, and of the statistics of its observations.
        expert: Digest of the shipped expert; "" for other agents.
    """

    choice: str
    env_id: EnvironmentOrId
    seed: int
    files: tuple[tuple[str, bytes], ...] = ()
    expert: str = ""

    @cached_property
    def digest(self) -> str:
        """What tells it from others in its environment and with its seed."""
        return " ".join([self.choice, self.expert, *(digest_of(part) for _, part in self.files)])

    def __call__(self) -> Agent:
        """Make it.

        Raises:
            InputError: If it cannot be made.
        """
        own = own_agents().get(self.choice)
        if own is not None:
            agent = own_agent(own, self.env_id)
            if isinstance(agent, OwnAgent):
                agent.name = self.choice
            return agent
        if not self.files:
            return make_agent(self.choice, self.env_id, seed=self.seed)
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder) / Path(name).name for name, _ in self.files]
            for path, (_, content) in zip(paths, self.files, strict=True):
                path.write_bytes(content)
            try:
                agent = make_agent(
                    paths[0], self.env_id, seed=self.seed, normalise=next(iter(paths[1:]), None)
                )
            except SarlError as error:
                # The folder is ours; the person knows the file by its name.
                raise InputError(str(error).replace(f"{folder}/", "")) from error
            if not isinstance(agent, PolicyAgent):
                return agent
            return replace(
                agent, notes=tuple(note.replace(f"{folder}/", "") for note in agent.notes)
            )


@dataclass(frozen=True)
class PolicyFile:
    """A policy that a visitor uploaded, and the statistics of its observations, if it has any."""

    policy: UploadedFile
    statistics: UploadedFile | None = None

    @property
    def name(self) -> str:
        """As the visitor knows it."""
        return str(self.policy.name)


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
    file = PolicyFile(policy, statistics)
    say_notes(file, env)
    return file


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

    uploaded = [PolicyFile(policy, of(policy)) for policy in policies]
    used = [file.statistics for file in uploaded]
    for file in statistics:
        if file not in used:
            st.warning(
                f"{file.name} was not used: call it NAME_vecnormalize.pkl if it belongs to NAME.zip"
            )
    for policy in uploaded:
        say_notes(policy, env)
    return uploaded


def say_notes(file: PolicyFile, env: str | None) -> None:
    """Say on the page how a policy was read, and what looks odd in it."""
    try:
        env_id = environment_of(env)
        notes = _notes(agent_for(OWN_FILE, file, env_id, 0))
    except SarlError:
        return  # the page says so where the policy is used
    for note in notes:
        st.warning(f"{note}.")


@cached()
def _notes(chosen: ChosenAgent) -> tuple[str, ...]:
    agent = chosen()
    return agent.notes if isinstance(agent, PolicyAgent) else ()


def agent_for(
    choice: str, uploaded: PolicyFile | None, env_id: EnvironmentOrId, seed: int
) -> ChosenAgent:
    """The agent that was chosen.

    Raises:
        InputError: If there is no such agent.
    """
    if choice not in offered_agents():
        raise InputError(f"there is no agent {quoted(choice)} here; choose another one")
    if choice != OWN_FILE:
        expert = _expert_digest(str(env_id), _latest_expert()) if choice == "expert" else ""
        return ChosenAgent(choice, env_id, seed, expert=expert)
    if uploaded is None:
        raise InputError("no policy has been uploaded; upload one, or choose another agent")
    files = [file for file in (uploaded.policy, uploaded.statistics) if file is not None]
    return ChosenAgent(
        choice, env_id, seed, tuple((str(file.name), file.getvalue()) for file in files)
    )
