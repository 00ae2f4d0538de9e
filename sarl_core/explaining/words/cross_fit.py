"""What a whole rule set is worth elsewhere, in words, and a warning where it is worth much less."""

from __future__ import annotations

from sarl_core.explaining.words.evidence import influence_text, range_text, what_tells
from sarl_core.mining.evidence import FEWEST_EPISODES, HeldOut
from sarl_core.mining.language import counted, limit_text, share_text
from sarl_core.mining.validation.cross_fitting import Judged, parts
from sarl_core.mining.validation.recommendation import COVERAGE, NEAR, Recommendation


def elsewhere_text(held_out: HeldOut) -> str:
    """A share on other episodes, with what that can tell.

    Args:
        held_out: Of a whole rule set.

    Returns:
        As "91 % (78 to 99 %)".
    """
    if held_out.share is None:
        return "no state"
    text = share_text(held_out.share)
    return text if held_out.interval is None else f"{text} ({range_text(held_out.interval)})"


def judged_sentence(judged: Judged) -> str:
    """What a rule set is worth in episodes that it was not mined from.

    Args:
        judged: Cross-fitted, or held out.

    Returns:
        As "Where each of 62 episodes is judged by rules mined without it, they are right in 95 % of
        their states on average (between 92 and 98 % is what that can tell), and 29 % of the states
        of an episode have a rule (26 to 32 %)."
    """
    fidelity, coverage = judged.fidelity, judged.coverage
    count = len(judged.numbers)
    if not judged.folds:
        where = f"In {counted(count, 'episode')} that they were not mined from, the rules"
    elif judged.whole_episodes:
        where = (
            f"Where each of {counted(count, 'episode')} is judged by rules mined without it, they"
        )
    else:
        where = (
            f"There is one episode only. Where each of {count} stretches of it is judged by rules "
            "mined without it, they"
        )
    if fidelity.share is None:
        return f"{where} apply in no state."
    text = share_text(fidelity.share)
    if fidelity.interval is not None:
        text += f" of their states on average ({what_tells(fidelity.interval)})"
    else:
        text += " of their states on average"
        if judged.whole_episodes:
            text += " (too few episodes to say more)"
    reach = "" if coverage.interval is None else f" ({range_text(coverage.interval)})"
    one = "an episode" if judged.whole_episodes else "one"
    return (
        f"{where} are right in {text}, and {share_text(coverage.share or 0.0)} of the states of "
        f"{one} have a rule{reach}."
    )


def parting_text(mined: float, judged: Judged) -> str:
    """A warning where the fidelity on what was mined from parts from that on other episodes.

    Args:
        mined: Fidelity on what was mined from; NaN where there is none.
        judged: The same rules, or those of the same thresholds, on other episodes.

    Returns:
        One or two sentences; "" where there is nothing to warn of.
    """
    fidelity = judged.fidelity
    if fidelity.share is None or not parts(mined, fidelity):
        return ""
    where = "in episodes" if judged.whole_episodes else "in stretches of the episode"
    return (
        f"The rules are right in {share_text(mined)} of the states they were mined from, and only "
        f"in {elsewhere_text(fidelity)} {where} that they were not mined from. Part of what they "
        "say is chance: believe the second number. Rules of more states (a higher minimum support) "
        "part less."
    )


def influence_sentences(judged: Judged) -> list[str]:
    """Which episode alone moves the fidelity, and which would if every state counted for itself.

    Args:
        judged: A rule set on several episodes.

    Returns:
        None, one or two sentences.
    """
    sentences = []
    once = influence_text(judged.influence)
    if once:
        sentences.append(f"One episode alone moves this: {once}.")
    by_states = judged.influence_by_states
    text = influence_text(by_states)
    if text and by_states is not None:
        sentences.append(
            f"If every state counted for itself, the rules would be right in "
            f"{share_text(by_states.share)}, and {text}. Therefore each episode counts once."
        )
    return sentences


def recommendation_sentences(recommendation: Recommendation, action: str = "") -> str:
    """Which thresholds to take, why, and what that is worth where it was not chosen.

    Args:
        recommendation: Thresholds, and what they were compared with.
        action: Name of the action dimension that alone counts; "" for all.

    Returns:
        As "Recommended: support 0.02 and confidence 0.78. Elsewhere, these 6 rules apply in 51 % of
        the states and are right in 86.9 % of them (86.8 % in episodes without a say in this
        choice): the fewest within 2 points of the best, 87.3 % with 115 rules, of all that apply in
        at least 50 % of the states."
    """
    at, rules = recommendation.thresholds, recommendation.rules
    few = f"the fewest within {100 * NEAR:g} points of "
    why = (
        f"the best, and {few}it,"
        if recommendation.best_rules == rules
        else f"{few}the best, {share_text(recommendation.best, decimals=1)} with "
        f"{counted(recommendation.best_rules, 'rule')},"
    )
    fidelity, unseen = (
        share_text(share, decimals=1) for share in (recommendation.fidelity, recommendation.unseen)
    )
    subject = "this rule applies" if rules == 1 else f"these {rules:,} rules apply"
    return (
        f"Recommended{f' for {action}' if action else ''}: support {limit_text(at.support)} "
        f"and confidence {limit_text(at.confidence)}. Elsewhere, {subject} in "
        f"{share_text(recommendation.coverage)} of the states and {'is' if rules == 1 else 'are'} "
        f"right in {fidelity} of them ({unseen} in episodes without a say in this choice): {why} "
        f"of all that apply in at least {share_text(COVERAGE)} of the states."
    )


def no_recommendation_text(episodes: int) -> str:
    """Why no thresholds are recommended.

    Args:
        episodes: How many there are to judge by.

    Returns:
        One sentence.
    """
    if episodes < FEWEST_EPISODES:
        return (
            f"No thresholds are recommended: {counted(episodes, 'episode')} cannot tell which "
            f"rules are right in others; it takes at least {FEWEST_EPISODES}."
        )
    return (
        "No thresholds are recommended: at none do rules apply in at least "
        f"{share_text(COVERAGE)} of the states of other episodes."
    )
