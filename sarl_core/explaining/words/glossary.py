"""The words that screens, reports and the guide use, each in a sentence, and said nowhere else."""

from __future__ import annotations

# In Markdown. What a rule is made of comes before the rule, and a rule before the shield.
GLOSSARY = {
    "expert": "who or what did the task well while it was recorded: a person, a controller, a "
    "trained agent",
    "agent": "who or what acts in the task, and may be corrected by the rules",
    "environment": "the task as a program that can be played again, such as Lunar Lander; a log "
    "alone has none",
    "state": "what is known at one moment, as numbers",
    "step": "one moment of an episode: a state, and the action taken in it",
    "episode": "one attempt at the task, from start to end; its **return** is the sum of its "
    "rewards",
    "demonstrations": "states and the actions an expert took in them, in episodes",
    "feature": "one of the numbers that describe a state",
    "combination": 'a feature that is derived from two others, as "the position plus 0.5 s of '
    'velocity"',
    "ratio": "of a combination: how much of its second feature counts as much as one of the first",
    "formula": "a feature that a person wrote, as `gap / (own_speed - lead_speed)`",
    "action dimension": "one part of the action, as one joint of a walker; rules are mined for "
    "each on its own",
    "label": "what a rule says to do: a discrete action, or an interval of a continuous one",
    "divider": "into how many intervals of equal width a continuous action is cut",
    "support": "share of all demonstrated states in which a rule applies",
    "confidence": "of the states in which a rule applies, the share in which the expert did what "
    "it says",
    "lift": "confidence divided by the share of all states in which the expert did what the rule "
    "says",
    "rule": "conditions joined by *and*, and what to do where they hold",
    "length of a rule": "number of its conditions",
    "unfiltered, filtered": "the paper's two settings: support 0 and confidence 1; support 0.005 "
    "and confidence 0.95",
    "shield": "the rules in force: what is between an agent and its environment",
    "in force": "of rules: what is used now. In a state: the one that applies and decides",
    "projection": "what a continuous action becomes that a rule corrects: the centre of the "
    "rule's interval, the nearest value in it, or what the expert did there",
    "intervention": "a step at which the shield changed the action",
    "coverage": "share of states in which some rule applies",
    "fidelity": "share of the covered states in which the expert did what the rule says",
    "never-rule": "a rule that forbids an action and leaves all others: what the expert does at "
    "most rarely in states like these, or what it does not recover from",
    "epsilon": "of never-rules: the most that the share of a forbidden action may be, by its upper "
    "95 % bound",
    "probe": "an episode played again up to some state, where an action is done for a while before "
    "the expert has the controls; whether it fails then says what must not be done there",
    "freedom": "what the shield leaves to the agent: 100 % where no rule applies, 0 % where "
    "one decides every step",
    "audit": "rules held against a log of what somebody did, with no environment",
    "break": "a step of a log at which something else was done than the rule in force says",
    "failure": "an episode in which happened what the task must never let happen: a crash, a "
    "fall; known of the task, or named by the user",
    "cost": "what the steps of an episode cost in all, by what the environment or the user says",
    "worst tenth": "the mean of the worst tenth of the episodes (CVaR)",
    "mean of the middle half": "of the returns, without the lowest and the highest quarter "
    "(*IQM*; on some pages *typical return*); it hides crashes, so failures stand beside it",
    "certificate": "a test of whether at most so many episodes fail, at a certainty, and all that "
    "was tested",
    "novice": "an agent that has learned nothing: random actions",
    "held out": "of episodes: kept from mining, so that rules can be tried on them",
    "95 % interval": "where the true value lies, but for one time in twenty; wide where there are "
    "few episodes",
    "elsewhere": "measured on episodes that the rules were not mined from",
}


def meaning_of(word: str) -> str:
    """What a word means, as a sentence.

    Args:
        word: One of `GLOSSARY`.

    Returns:
        In Markdown.
    """
    meaning = GLOSSARY[word]
    return f"{meaning[0].upper()}{meaning[1:]}."
