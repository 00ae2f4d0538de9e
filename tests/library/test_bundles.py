"""What travels to another machine is what was sent, and nothing else comes with it."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, RuleSet, load_demonstrations, mine_rules
from sarl_core.demonstrations.dataset import with_formulas
from sarl_core.errors import InputError
from sarl_core.library import Item, Library
from sarl_core.library.bundles import export_bundle, import_bundle
from sarl_core.library.contents import add_demonstrations, add_rules, demonstrations_of, rules_of
from sarl_core.library.results import add_note, note_text, notes_about

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def shown() -> Demonstrations:
    cart = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet").select(range(2))
    return with_formulas(cart, ["lean [rad] = 2 * pole angle"])


@pytest.fixture
def library(tmp_path: Path) -> Library:
    with Library(tmp_path / "here") as library:
        yield library


@pytest.fixture
def there(tmp_path: Path) -> Library:
    with Library(tmp_path / "there") as library:
        yield library


@pytest.fixture
def rules(library: Library, shown: Demonstrations) -> Item:
    """The second version of rules, with their demonstrations."""
    of = add_demonstrations(library, shown, "the crane", author="Ada", command="record it")
    mined = mine_rules(shown, supp_min=0.01, conf_min=0.9)
    first = add_rules(library, mined, "rules", author="Ada", came_from=[of.id])
    fewer = mine_rules(shown, supp_min=0.05, conf_min=0.9)
    second = add_rules(
        library, fewer, "rules", author="Ada", parent=first.id, came_from=[of.id], shared=True
    )
    return library.approve(second.id, author="Eve", note="seen")


@pytest.fixture
def bundle(library: Library, rules: Item, tmp_path: Path) -> Path:
    export_bundle(library, [rules.id], tmp_path / "rules.sarl")
    return tmp_path / "rules.sarl"


def test_rules_travel_with_their_data_versions_and_approvals(
    library: Library, there: Library, rules: Item, bundle: Path, shown: Demonstrations
) -> None:
    for _ in range(2):  # the second time changes nothing
        items = import_bundle(there, bundle, author="Bob")
        assert len(items) == len(there.items()) == 3
        again = there.item(rules.id)
        assert again.author == "Bob"
        assert again.details["made_by"] == "Ada"
        assert again.approvals == rules.approvals
        assert (again.created, again.digest, again.files) == (
            rules.created,
            rules.digest,
            rules.files,
        )
        assert rules_of(there, again) == rules_of(library, rules)
        assert [one.id for one in there.versions(again.id)] == [
            one.id for one in library.versions(rules.id)
        ]
        (of,) = again.came_from
        copied = demonstrations_of(there, there.item(of))
        assert copied.digest == shown.digest
        assert copied.derived == shown.derived


def test_notes_travel_with_what_they_are_about(
    library: Library, there: Library, rules: Item, tmp_path: Path
) -> None:
    other = add_note(library, "Of no concern here.", author="Ada")
    first = add_note(library, "Why so few?", author="Ada", about=[rules.id, other.id])
    second = add_note(library, "Read it to the operators.", author="Eve", about=[rules.id])
    to_data = add_note(library, "Recorded in March.", author="Ada", about=rules.came_from)
    answer = add_note(library, "They can be read.", author="Eve", about=[first.id])
    gone = add_note(library, "Not meant.", author="Ada", about=[rules.id])
    library.remove(gone.id, author="Ada")
    path = tmp_path / "with notes.sarl"
    sent = {item.id for item in export_bundle(library, [rules.id], path)}
    assert {first.id, second.id, to_data.id, answer.id} < sent
    assert not {other.id, gone.id} & sent
    for _ in range(2):
        assert {item.id for item in import_bundle(there, path, author="Bob")} == sent
        brought = notes_about(there, there.item(rules.id))
        assert [note_text(there, one) for one in brought] == [
            "Why so few?",
            "Read it to the operators.",
        ]
        assert [one.details["made_by"] for one in brought] == ["Ada", "Eve"]
        assert [one.id for one in notes_about(there, there.item(first.id))] == [answer.id]
        assert [one.id for one in notes_about(there, there.item(rules.came_from[0]))] == [
            to_data.id
        ]


def test_a_note_in_a_bundle_is_what_was_written(
    library: Library, there: Library, rules: Item, tmp_path: Path
) -> None:
    add_note(library, "Why so few?", author="Ada", about=[rules.id])
    path = tmp_path / "rules.sarl"
    export_bundle(library, [rules.id], path)

    def with_another_text(listed: dict, files: dict[str, bytes]) -> None:
        (name,) = (name for name in files if name.endswith(".txt"))
        files[name] = b"x" * len(files[name])

    with pytest.raises(InputError, match="is not what it was when it was exported"):
        import_bundle(there, changed(path, with_another_text), author="Bob")
    assert there.items() == []


def changed(bundle: Path, change: Callable[[dict, dict[str, bytes]], None]) -> Path:
    """The bundle with another list and other files."""
    with zipfile.ZipFile(bundle) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    listed = json.loads(files.pop("bundle.json"))
    change(listed, files)
    with zipfile.ZipFile(bundle, "w") as archive:
        archive.writestr("bundle.json", json.dumps(listed))
        for name, content in files.items():
            archive.writestr(name, content)
    return bundle


class Payload:
    def __reduce__(self):
        return (Path.touch, (Path("/tmp/sarl-was-here"),))


def with_payload(listed: dict, files: dict[str, bytes]) -> None:
    files["payload.pkl"] = pickle.dumps(Payload())


def with_path_outside(listed: dict, files: dict[str, bytes]) -> None:
    files["../../outside.txt"] = b"x"


def with_ending_outside(listed: dict, files: dict[str, bytes]) -> None:
    listed["items"][0]["files"][0]["ending"] = "/../../outside"


def with_pickled_data(listed: dict, files: dict[str, bytes]) -> None:
    """A whole list, and in the place of the demonstrations' file an array of objects."""
    out = io.BytesIO()
    np.savez(out, observations=np.array([Payload()], dtype=object))
    replace_file(listed, files, "demonstrations", out.getvalue(), ".npz")


def replace_file(listed: dict, files: dict, role: str, content: bytes, ending: str) -> None:
    import hashlib

    for item in listed["items"]:
        for file in item["files"]:
            if file["role"] == role:
                files.pop(f"files/{file['digest']}{file['ending']}", None)
                digest = hashlib.blake2b(content, digest_size=16).hexdigest()
                file |= {"digest": digest, "ending": ending, "size": len(content)}
                item["size"] = len(content)
                files[f"files/{digest}{ending}"] = content


def with_another_digest(listed: dict, files: dict[str, bytes]) -> None:
    listed["items"][0]["digest"] = "0" * 32


def with_another_file(listed: dict, files: dict[str, bytes]) -> None:
    name = next(iter(files))
    files[name] = bytes(len(files[name]))


def with_a_shorter_file(listed: dict, files: dict[str, bytes]) -> None:
    name = next(iter(files))
    files[name] = files[name][:-1]


def without_a_file(listed: dict, files: dict[str, bytes]) -> None:
    files.popitem()


def of_a_newer_version(listed: dict, files: dict[str, bytes]) -> None:
    listed["version"] = 2


def with_an_unknown_field(listed: dict, files: dict[str, bytes]) -> None:
    listed["items"][0]["script"] = "x"


def without_a_role(listed: dict, files: dict[str, bytes]) -> None:
    for item in listed["items"]:
        item["files"][0]["role"] = "other"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (with_payload, "it holds 'payload.pkl', which no list of it names"),
        (with_path_outside, "it holds '../../outside.txt', which no list"),
        (with_ending_outside, "its list is damaged"),
        (with_pickled_data, "cannot be read"),
        (with_another_digest, "is not what was exported (its digest differs)"),
        (with_another_file, ""),
        (with_a_shorter_file, "is damaged; export it again"),
        (without_a_file, "is missing in it; export it again"),
        (of_a_newer_version, "it is of version 2, and this program reads version 1"),
        (with_an_unknown_field, "'script' is not known"),
        (without_a_role, "it holds no"),
    ],
)
def test_what_was_changed_on_the_way_is_refused_whole(
    there: Library, bundle: Path, change, says: str
) -> None:
    changed(bundle, change)
    with pytest.raises(InputError) as told:
        import_bundle(there, bundle, author="Bob")
    assert says in str(told.value)
    assert str(told.value).startswith(str(bundle))
    assert not Path("/tmp/sarl-was-here").exists()
    assert there.items() == []
    assert not list(bundle.parent.rglob("outside*"))


@pytest.mark.parametrize("content", [b"", b"PK", b"{}", b"no archive"])
def test_what_is_no_bundle_is_refused(there: Library, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.sarl"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"x\.sarl: "):
        import_bundle(there, path, author="Bob")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other.json", "{}")
    with pytest.raises(InputError, match="no file that was exported from a library"):
        import_bundle(there, path, author="Bob")


def test_what_was_removed_stays_behind(library: Library, rules: Item, tmp_path: Path) -> None:
    out = tmp_path / "some.sarl"
    library.remove(rules.parent, author="Ada")
    assert {item.kind for item in export_bundle(library, [rules.id], out)} == {
        "rules",
        "demonstrations",
    }
    before = out.read_bytes()
    for item in library.items():
        library.remove(item.id, author="Ada")
    with pytest.raises(InputError, match="was removed; bring it back first"):
        export_bundle(library, [rules.id], out)
    with pytest.raises(InputError, match=r"\.sarl"):
        export_bundle(library, [rules.id], tmp_path / "some.zip")
    assert out.read_bytes() == before


def test_a_file_that_is_missing_leaves_no_half_bundle(
    library: Library, rules: Item, tmp_path: Path
) -> None:
    library.path(rules).unlink()
    with pytest.raises(InputError, match="is missing from the library"):
        export_bundle(library, [rules.id], tmp_path / "some.sarl")
    assert not list(tmp_path.glob("*.sarl*"))


def test_what_is_kept_as_one_thing_is_not_read_as_another(library: Library, rules: Item) -> None:
    with pytest.raises(InputError, match="'rules' is a rule set and holds no demonstrations"):
        demonstrations_of(library, rules)
    note = library.add("note", "words", {}, author="Ada")
    with pytest.raises(InputError, match="'words' is a note and holds no rules"):
        rules_of(library, note)


def test_edited_rules_are_kept_with_every_edit(library: Library) -> None:
    edited = RuleSet.load(DATA / "rules" / "cartpole_combined.json")
    assert rules_of(library, add_rules(library, edited, "r", author="Ada")) == edited
