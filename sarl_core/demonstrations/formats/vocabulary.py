"""What people call the columns of a table: the words that tell what one holds."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

OBSERVATIONS = "obs|observations?|states?|features?"
PLAIN_OBSERVATIONS = "obs|observations?"  # the names of nothing else begin so
ACTIONS = "actions?|acts?"
SINGLE_ACTION = ("action", "actions", "act", "acts", "a")
# The same in other languages, where it means nothing else.
ACTION_ELSEWHERE = re.compile(
    r"aktion(en)?|handlung(en)?|acci[oó]n(es)?|azion[ei]|a[cç][aã]o|a[cç][oõ]es|actie"
    r"|行動|動作|动作|操作"
)

_COUNTED = "(_?(id|ids|index|idx|no|nr|num|number|count))?"
# A date alone says of no step when it was, so that it is one of the times that nobody reads.
_WHICH = "((unix|wall|sim|real|elapsed|clock|utc|local)_?)?"
_HOW = "(_(s|sec|secs|seconds|ms|us|ns|utc|unix))?"
_TIMES = (
    rf"{_WHICH}(time|time_?stamp|date_?time|ts){_HOW}"
    r"|.*_timestamp|elapsed(_(s|sec|secs|seconds|ms))?|utc|unix|ms|secs?|seconds|t_(s|ms)"
    r"|zeit(punkt|stempel)?|uhrzeit|horodatage|tiempo|tijd|時刻|時間|时间|日時"
)
_RUNS = (
    "(run|demo|demonstration|trial|trip|session|versuch|durchlauf|durchgang|lauf|fahrt|essai"
    "|ensayo|prova|試行|回)"
)
# Of a name as `plain` gives it; the first pattern that a column matches takes the role.
ROLES: Mapping[str, tuple[str, ...]] = {
    "episode": (
        rf"(episode|ep|eps|traj|trajectory|rollout)s?{_COUNTED}",
        r"[eé]pisodi?[eons]*|trayectoria|traiettoria|エピソード|回合",
        rf"{_RUNS}{_COUNTED}",
    ),
    "step": (
        rf"(step|time_?step|env_?step)s?{_COUNTED}",
        r"zeitschritt|schritt|ステップ|步",
        "t",
        rf"(frame|tick){_COUNTED}",
    ),
    "reward": ("rewards?|rews?|belohnung|r[eé]compense|recompensa|ricompensa|報酬|奖励", "r"),
    "terminated": ("(is_?)?(terminated|terminal|termination|done)s?",),
    "truncated": ("(is_?)?(truncated|truncation|timeout)s?",),
    "first": ("is_?first|is_?start|first_step|episode_starts?",),
    "last": ("is_?last|is_?end|last_step|episode_ends?",),
    "time": (_TIMES,),
}
# Words for a role that may as well name a feature; what the column holds decides.
DOUBTFUL_ROLES = re.compile(rf"({_RUNS}|frame|tick){_COUNTED}|t")
# What a delimiter at the end of each line makes; in the first place it is the next.
UNNAMED = re.compile(r"unnamed:_[1-9]\d*")
# Numbers that a data frame wrote along.
ROW_NUMBERS = re.compile(
    r"|#|index|idx|unnamed:_\d+|__index_level_\d+__|(row|line)_?(id|index|idx|no|nr|num|number)"
)
TIMES = re.compile(f"{_TIMES}|{_WHICH}date{_HOW}|datum|fecha|日期")
# What learners write along, and no agent sees.
BOOKKEEPING = re.compile(
    r"discounts?|(action_)?log_?p(robs?)?|advantages?|returns?_to_go|rtg|infos?(_.*)?"
)
UNCLEAR = re.compile(r"id|.*_ids?|uid|uuid|seeds?|returns?|values?|q_values?")
CONTROLS = re.compile(
    r"brakes?|braking|accelerat(e|or)|coast|throttle|gas|steer(ing)?(_.*)?|pedal|torque|force"
    r"|thrust|u|move|button|decision|choice|(.*_)?(cmd|command|control|action)"
    r"|befehl|entscheidung|commande|comando|mando|指令"
)

_CLOCK = r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*([ap]m)?\s*(z|utc|[+-]\d{2}:?\d{2})?"
_DATE = r"(\d{4}[-./]\d{1,2}[-./]\d{1,2}|\d{1,2}[-./]\d{1,2}[-./](\d{4}|\d{2}(?=[ t])))"
_TIME = re.compile(rf"{_DATE}([ t]+{_CLOCK})?|{_CLOCK}|\d{{8}}t\d{{6}}z?", re.I)
_PERHAPS_ACTION = re.compile(r"a|.+_(actions?|acts?)|cmd|commands?|controls?|decision|choice")

_NEXT = ("next", "nxt", "new", "succ", "successor", "future", "prime")
_ONLY_NEXT = frozenset({"next", "nxt", "succ", "successor", "prime"})
_BEFORE = frozenset({"prev", "previous", "last", "lag", "lagged", "old", "past", "before"})
_STATES = frozenset({"s", "o", "ob", "obs", "state", "states", "observation", "observations"})


def plain(name: str) -> str:
    """A name without case, unit, separators and a last point: "Time Step (ms)" is "time_step"."""
    text = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.strip())
    text = re.sub(r"[ _]*(\[[^\]\d]*\]|\([^)\d]*\))$", "", text) or text
    text = text.rstrip(".") or text
    return re.sub(r"[ .\-/_]+", "_", text.lower()) if not text.startswith("__") else text.lower()


def numbers_rows(name: str) -> bool:
    """Whether a column's name says that a data frame wrote its row numbers along."""
    return ROW_NUMBERS.fullmatch(plain(name)) is not None


def stripped(column: str, prefixes: str) -> str | None:
    """What follows a prefix: "x" of "obs_x", "0" of "obs[0]" and "obs0"; None if nothing does."""
    bare = re.fullmatch(rf"(?:{prefixes})(\d*)", column.strip(), re.I)
    if bare is not None:
        return bare[1] or "0"
    match = re.match(rf"(?:{prefixes})([ _.\-/\[(])", column, re.I)
    if match is None:
        return None
    rest = column[match.end() :]
    return rest[:-1] if match[1] in "[(" and rest[-1:] in ("]", ")") else rest


def first_of(names: Sequence[str], patterns: Sequence[str]) -> str | None:
    """The first column that matches the first pattern that any matches."""
    for pattern in patterns:
        for name in names:
            if re.fullmatch(pattern, plain(name)):
                return name
    return None


def next_states(names: Sequence[str]) -> dict[str, str]:
    """Columns whose names say that they hold what another column holds a step later.

    Args:
        names: Of all columns.

    Returns:
        The other column for each of them; as "x" for "next_x", "x_next" and "x'".
    """
    keys = {name: _words(name) for name in names}
    others = {words: name for name, words in keys.items() if not _marked(words)}
    bases = {}
    for name, words in keys.items():
        base = tuple(word for word in map(_unmarked, words) if word)
        if _marked(words) and base in others:
            bases[name] = others[base]
    return bases


def perhaps_next_states(names: Sequence[str], *, numbered: bool) -> dict[str, str]:
    """As `next_states`, for names as "ns0" and "sp_0", which may mean something else.

    Args:
        names: Of all columns.
        numbered: Whether "obs2_0" may be the next "obs1_0".

    Returns:
        The other column for each of them.
    """
    keys = {_words(name): name for name in names}
    bases = {}
    for words, name in keys.items():
        for base in _shortened(words) + (_first_of_two(words) if numbered else []):
            if base in keys and keys[base] != name:
                bases[name] = keys[base]
                break
    return bases


def is_state_word(name: str) -> bool:
    """Whether a name begins as textbooks call states: s, s0, obs."""
    words = _words(name)
    return bool(words) and words[0] in _STATES


def is_perhaps_action(name: str) -> bool:
    """Whether a column may be the action under a longer name or another word, or is called "a"."""
    return _PERHAPS_ACTION.fullmatch(plain(name)) is not None and not (
        says_before(name) or only_next(name)
    )


def likely_actions(names: Iterable[str]) -> list[str]:
    """The columns whose names may be those of actions."""
    return [name for name in names if is_perhaps_action(name) or CONTROLS.fullmatch(plain(name))]


def is_time(word: str) -> bool:
    """Whether a text is a date, a time of day, or both."""
    return _TIME.fullmatch(word) is not None


def ends_as_action(name: str) -> bool:
    """Whether a name says whose action a column holds, as "operator_action"."""
    return re.fullmatch(r".+_(actions?|acts?)", plain(name)) is not None and not (
        says_before(name) or only_next(name)
    )


def only_next(name: str) -> bool:
    """Whether a name says "next", be there a column that it follows or not."""
    return bool(_ONLY_NEXT.intersection(_words(name)))


def says_before(name: str) -> bool:
    """Whether a name says that a column holds what was a step earlier."""
    return bool(_BEFORE.intersection(_words(name)))


def _words(name: str) -> tuple[str, ...]:
    """The words and numbers of a name: "s'_0" has s, prime and 0."""
    text = re.sub(r"['′’]|(?<=[^\W_])_$", "_prime_", plain(name))  # "s_" is an "s'" too
    text = re.sub(r"_t(_?\+_?|p)1$", "_next", text)
    return tuple(re.findall(r"[^\W\d_]+|\d+|[^\w\s]", text))


def _marked(words: tuple[str, ...]) -> bool:
    return any(_unmarked(word) != word for word in words)


def _unmarked(word: str) -> str:
    """A word without what says "next": nothing of "next", "pos" of "nextpos"."""
    if word in _NEXT:
        return ""
    for mark in ("next", "nxt"):
        if word.startswith(mark) or word.endswith(mark):
            return word.removeprefix(mark).removesuffix(mark)
    return word


def _shortened(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """What "ns0", "sp_0", "n_x" and "newpos" may be the next of."""
    if not words:
        return []
    first, rest = words[0], words[1:]
    shorter = [(first[1:], *rest)] if first[0] == "n" and len(first) > 1 else []
    if first.startswith("new") and len(first) > len("new"):
        shorter.append((first[len("new") :], *rest))
    if first[-1] in "np" and len(first) > 1:
        shorter.append((first[:-1], *rest))
    if first in ("n", "p"):
        shorter.append(rest)
    if rest[:1] in (("n",), ("p",)):
        shorter.append((first, *rest[1:]))
    return shorter


def _first_of_two(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """What "obs2_0" may be the next of; "s2" is the second of several."""
    if words[1:2] != ("2",) or len(words) < 3:
        return []
    return [(words[0], *words[2:]), (words[0], "1", *words[2:])]
