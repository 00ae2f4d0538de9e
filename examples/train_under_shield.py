"""A learner of Stable-Baselines3 that explores under a shield (needs the extra `learning`)."""

from __future__ import annotations

from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

from sarl_core import Shield, ShieldedVecEnv, load_rules
from sarl_core.shipped import DATA

STEPS = 4_096


def main() -> None:
    """Learn with rules in force, and see what is learned once they are gone."""
    rules = load_rules(DATA / "rules" / "cartpole_compact.json")
    venv = make_vec_env("CartPole-v1", n_envs=4, seed=0)
    shielded = ShieldedVecEnv(venv, Shield(rules), penalty=0.1)
    model = PPO("MlpPolicy", shielded, n_steps=256, seed=0)
    model.learn(STEPS)
    returns, _ = evaluate_policy(
        model, venv, n_eval_episodes=10, return_episode_rewards=True, warn=False
    )
    print(f"without the shield, after {STEPS:,} steps: mean return {sum(returns) / 10:.0f}")
    print("Whoever is only overridden learns little; `sarl learn` compares better ways.")


if __name__ == "__main__":
    main()
