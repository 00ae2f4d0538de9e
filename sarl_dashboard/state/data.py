"""What is chosen, and the cached ways to everything that follows from it.

The URL holds every choice. Widgets that can bind themselves to it; the choices that cannot (the
data set, whose name on screen is not its name in the URL, and the rule, which is a selection in
a table) go through `url_choice`.
"""

from __future__ import annotations

from contextlib import suppress
from typing import cast

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError, quoted
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached, visit
from sarl_dashboard.session import end_page
from sarl_dashboard.state import combining, formulas, given_names, hold_out, library
from sarl_dashboard.state.hold_out import Parts
from sarl_dashboard.state.thresholds import THRESHOLDS, Settled, settle
from sarl_dashboard.state.url import set_url_choice, url_name
from sarl_dashboard.text import refuse

SHIPPED_SETS = {
    "lunar_lander": ("Lunar Lander", "LunarLander-v3"),
    "cartpole": ("Cart Pole", "CartPole-v1"),
    "pendulum": ("Pendulum", "Pendulum-v1"),
    "bipedal_walker": ("Bipedal Walker", "BipedalWalker-v3"),
    "lunar_lander_continuous": ("Lunar Lander, continuous", "LunarLanderContinuous-v3"),
    "driving": ("Driving", "Driving-v0"),
}
UPLOAD = "upload"
DEFAULT_DATA = "lunar_lander"
_MOST_LISTED = 20  # of what is kept; the page Library has all
DATA_FOLDER = DATA / "demonstrations"


# --- what is chosen ----------------------------------------------------------------------------


def dataset_labels() -> dict[str, str]:
    """What may be chosen, and what it is called: shipped sets, what is kept, an upload.

    Also what a link names that is not here.
    """
    labels = {name: dataset_label(name) for name in SHIPPED_SETS}
    own = library.own_demonstrations()
    for item in own[:_MOST_LISTED]:
        # Streamlit tells options by what they are called: no two may be called alike.
        called = (item.name, f"{item.name} ({item.created.astimezone():%d %b, %H:%M:%S})")
        free = [label for label in called if label not in labels.values()]
        labels[item.id] = free[0] if free else f"{item.name} ({item.id})"
    if not st.session_state.get("_upload_id"):  # it has a place in the list
        labels[UPLOAD] = dataset_label(UPLOAD)
    name = chosen_dataset()
    if name not in labels:
        label = dataset_label(name)
        labels[name] = f"{label} ({name[:26]})" if label in labels.values() else label
    return labels


def dataset_label(name: str) -> str:
    """What a data set is called on screen."""
    if name in SHIPPED_SETS:
        return SHIPPED_SETS[name][0]
    if name == UPLOAD:
        return "Your upload"
    try:
        return library.standing_item(name).name
    except SarlError:
        return "Not here"


def chosen_dataset() -> str:
    """What is chosen: the name of a shipped set, an id of the library, or "upload".

    A link may name anything: what is not there is said (`data_problem`) and nothing else shown.
    """
    return url_name("data", DEFAULT_DATA)


def data_problem() -> str:
    """Why what a link or a choice names cannot be shown; "" where it can."""
    name = chosen_dataset()
    if name in SHIPPED_SETS or name == UPLOAD:
        return ""
    if not library.is_id(name):
        return (
            f"there are no demonstrations called {quoted(name)}; check the address, or choose "
            "others in the sidebar"
        )
    try:
        if st.session_state.get("_upload_id") != name:
            library.stored_demonstrations(name)
    except SarlError as error:
        return str(error)
    return ""


def choose_dataset(name: str) -> None:
    """Choose a data set, with all its episodes and rules at the thresholds; for callbacks."""
    hold_out.leave_out(())
    combining.choose_all()
    set_url_choice("set", THRESHOLDS, THRESHOLDS)
    for parameter in ("edits", "wording"):  # of other data, or of a link that named none
        set_url_choice(parameter, "")
        st.session_state[f"_{parameter}_named"] = ""
    set_url_choice("data", name, DEFAULT_DATA)


def set_upload(upload: Demonstrations | MinedData, *, file_name: str = "") -> None:
    """Keep uploaded demonstrations, or what is left of some, for this session, and choose them.

    Args:
        upload: Read and checked.
        file_name: Shown where the data is named.
    """
    visit().bring(upload.digest)
    st.session_state["_upload"] = upload
    st.session_state["_upload_name"] = file_name
    st.session_state["_upload_id"] = ""
    try:
        identifier = library.keep(upload, file_name or "demonstrations")
    except SarlError as error:
        library.say_once(error)
        choose_dataset(UPLOAD)
        return
    st.session_state["_upload_id"] = identifier
    _with_notes(steps_of(upload))
    choose_dataset(identifier)


def upload_name() -> str:
    """What the command line would take for the chosen demonstrations that are not shipped."""
    name = chosen_dataset()
    if library.is_id(name) and name != st.session_state.get("_upload_id"):
        return f"library:{name}"
    return str(st.session_state.get("_upload_name") or "demonstrations.parquet")


def is_upload_chosen() -> bool:
    """Whether what was uploaded last in this visit is what is chosen."""
    return chosen_dataset() in (UPLOAD, st.session_state.get("_upload_id"))


def uploaded_demonstrations() -> Demonstrations | None:
    """The demonstrations uploaded in this session, if any; no sample of a mined file."""
    upload = st.session_state.get("_upload")
    return upload if isinstance(upload, Demonstrations) else None


def _opened() -> Demonstrations | MinedData | None:
    """What is chosen as it was read; None while nothing is uploaded.

    What cannot be read is said on the page, which then stops.
    """
    name = chosen_dataset()
    if is_upload_chosen():
        return cast("Demonstrations | MinedData | None", st.session_state.get("_upload"))
    try:
        if name not in SHIPPED_SETS:
            stored = library.stored_demonstrations(name)
            _with_notes(steps_of(stored))
            return stored
        return shipped_demonstrations(name)
    except SarlError as error:
        refuse(error)
        end_page()


def raw_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations as they were read; None while nothing is uploaded.

    Of a mined file they are a sample, and say so. What cannot be read is said on the page, which
    then stops.
    """
    opened = _opened()
    return None if opened is None else steps_of(opened)


def mined_data() -> MinedData | None:
    """What is left of demonstrations that were mined elsewhere, under the names given to them.

    None where the steps themselves are chosen: their trees are grown here.
    """
    opened = _opened()
    if not isinstance(opened, MinedData):
        return None
    return _under_names(opened, given_names.named(opened.sample))


@cached()
def _under_names(mined: MinedData, sample: Demonstrations) -> MinedData:
    return mined.renamed(sample)


def steps_of(opened: Demonstrations | MinedData) -> Demonstrations:
    """Demonstrations; of a mined file the sample."""
    return opened.sample if isinstance(opened, MinedData) else opened


def settle_choices() -> None:
    """Leave to a mined file what was settled when it was mined; before anything is chosen.

    And let the visit hold what it has opened: after a reload it is that of another one.
    """
    opened = None if data_problem() else _opened()
    if opened is not None and (is_upload_chosen() or not visit().upload):
        visit().bring(opened.digest)
    settle(Settled(opened.divider, opened.min_support) if isinstance(opened, MinedData) else None)


def _with_notes(raw: Demonstrations) -> None:
    """Give kept demonstrations, in the first run of a visit, the names and formulas they had."""
    ready = st.session_state.setdefault("_restored", set())
    if raw.digest not in ready:
        ready.add(raw.digest)
        details = library.details_of(raw)
        # What does not fit was written by another version; the data themselves are here.
        with suppress(SarlError, KeyError, TypeError):
            formulas.restore(raw, details)
            given_names.restore(raw, details)


# The way of the data: as it was read (`raw_demonstrations`), with a visitor's `formulas` and under
# the names given to it (`all_demonstrations`), less what is left out, less what is held out
# (`hold_out`), with combinations of its features (`combining`). What rules are mined from is what
# remains.


def all_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations with every episode; None while nothing is uploaded."""
    raw = raw_demonstrations()
    return None if raw is None else given_names.named(raw)


def data_key() -> str:
    """What tells the data that rules are mined from, whatever names were given to them."""
    raw, choice = raw_demonstrations(), hold_out.chosen()
    drawn = (choice.share, choice.seed) if choice.share else ()
    combinations = combining.chosen()
    derived: tuple[object, ...] = (combinations,) if combinations.on else ()
    if raw is not None and (written := formulas.values_key(raw)) is not None:
        derived += (written,)
    return repr(("" if raw is None else raw.digest, choice.left_out, drawn, *derived))


def uncombined_parts() -> Parts | None:
    """What is mined from and what is held out, as it was observed; None without an upload."""
    demonstrations = all_demonstrations()
    return None if demonstrations is None else hold_out.parted(demonstrations)


def data_parts() -> Parts | None:
    """What is mined from and what is held out; None while nothing is uploaded."""
    parts = uncombined_parts()
    return None if parts is None else combining.combined(parts)


def chosen_demonstrations() -> Demonstrations | None:
    """The demonstrations that rules are mined from, and every page works on.

    None while nothing is uploaded.
    """
    parts = data_parts()
    return None if parts is None else parts.mined


def held_out_demonstrations() -> Demonstrations | None:
    """The episodes that rules are tried on; None where nothing is held out."""
    parts = data_parts()
    return None if parts is None else parts.held_out


def uncombined_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations with no combinations, whatever rules are mined with."""
    parts = uncombined_parts()
    return None if parts is None else parts.mined


def require_demonstrations() -> Demonstrations:
    """The chosen demonstrations; where there are none, say what to do and stop the page."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None:
        st.info(
            "Nothing has been uploaded in this session. Upload a file on the Demonstrations "
            "page, or choose a shipped set in the sidebar.",
            icon=":material/upload_file:",
        )
        st.page_link(
            "demonstrations.py", label="Go to Demonstrations", icon=":material/arrow_forward:"
        )
        end_page()
    return demonstrations


# --- what follows, cached ----------------------------------------------------------------------


@cached(show_spinner="Reading the demonstrations …")
def shipped_demonstrations(name: str) -> Demonstrations:
    """A shipped set.

    Args:
        name: One of `SHIPPED`.

    Returns:
        Its demonstrations, shared between sessions (they are immutable).
    """
    from sarl_core.demonstrations.formats import load_demonstrations

    return load_demonstrations(DATA_FOLDER / f"{name}.parquet")
