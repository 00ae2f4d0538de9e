from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations
from sarl_core.demonstrations.formats import save_demonstrations
from tests.app.screens import errors, metrics, open_page, texts
from tests.bad_inputs import BAD_INPUTS, HEADER, ROWS, csv_bytes, npz_bytes


def upload(app: AppTest, *files: tuple[str, bytes]) -> AppTest:
    uploader = app.file_uploader(key="upload_files")
    uploader.set_value([(name, content, "application/octet-stream") for name, content in files])
    return app.run()


@pytest.mark.parametrize(
    ("data", "features", "actions"),
    [("lunar_lander", "8", "4"), ("cartpole", "4", "2"), ("pendulum", "3", "1")],
)
def test_a_shipped_set_is_told_in_numbers_and_figures(
    data: str, features: str, actions: str
) -> None:
    app = open_page("demonstrations", data=data)
    shown = metrics(app)
    assert shown["Steps"] == "15,000"
    assert shown["Features"] == features
    assert shown["Actions"] == actions
    # A figure for each feature, one for the action, one for returns, one for lengths.
    assert len(app.get("plotly_chart")) == int(features) + 3
    assert not errors(app)


def test_an_upload_is_chosen_and_counted() -> None:
    app = upload(open_page("demonstrations", data="pendulum"), ("mine.csv", csv_bytes(*ROWS)))
    assert not app.exception
    assert not errors(app)
    shown = metrics(app)
    assert (shown["Steps"], shown["Episodes"], shown["Features"]) == ("5", "2", "2")
    assert shown["Mean return"] == "–"
    assert app.query_params["data"] not in ("upload", "pendulum")  # it has an id of its own


def test_the_pair_of_files_is_read() -> None:
    app = upload(
        open_page("demonstrations"),
        ("obs.csv", b"0.5;1.5\n0.25;1.0\n0.1;0.2\n"),
        ("actions.csv", b"0\n1\n0\n"),
    )
    assert not errors(app)
    assert metrics(app)["Steps"] == "3"
    assert "one episode" in texts(app)


def test_several_files_are_one_set_in_their_natural_order() -> None:
    names = ("run_10.csv", "run_2.csv", "run_1.csv")
    files = [(name, f"obs_x,action\n{name[4:-4]},0\n0.5,1\n".encode()) for name in names]
    app = upload(open_page("demonstrations"), *files)
    assert not errors(app)
    assert (metrics(app)["Steps"], metrics(app)["Episodes"]) == ("6", "3")
    assert "from 'run_1.csv' to 'run_10.csv'" in texts(app)


def test_files_of_other_columns_are_refused_by_name() -> None:
    files = [("a.csv", csv_bytes(*ROWS)), ("b.csv", b"obs_x,action\n0.5,1\n")]
    app = upload(open_page("demonstrations"), *files)
    assert errors(app) == [
        "2 files: b.csv: it has no column 'episode', and 'a.csv' has; give files of the same "
        "columns."
    ]


@pytest.mark.parametrize("name", BAD_INPUTS)
def test_a_bad_input_is_one_sentence_and_loses_nothing(name: str) -> None:
    file_name, content, fragments = BAD_INPUTS[name]
    app = open_page("demonstrations", data="cartpole")
    before = metrics(app)
    upload(app, (file_name, content))
    assert not app.exception, app.exception
    (sentence,) = errors(app)
    assert all(fragment.replace("\\", "") in sentence for fragment in fragments)
    assert metrics(app) == before
    assert app.query_params["data"] == "cartpole"
    assert "Nothing has changed: the set below is still the one chosen." in texts(app)


def test_what_each_column_was_taken_for_is_shown() -> None:
    rows = [f"{i},{i % 7},{i % 2}" for i in range(30)]
    app = upload(
        open_page("demonstrations"), ("rig.csv", csv_bytes(*rows, header="row,speed,action"))
    )
    assert not errors(app)
    (shown,) = [frame.value for frame in app.dataframe if "Taken for" in frame.value]
    assert dict(zip(shown["Column"], shown["Taken for"], strict=True)) == {
        "row": "not used",
        "speed": "feature",
        "action": "action",
    }
    assert "'row' was not used: it counts the rows" in texts(app)


def test_columns_of_other_names_are_mapped() -> None:
    odd = csv_bytes(*ROWS, header="run,t,left,right,move")
    app = upload(open_page("demonstrations", data="pendulum"), ("odd.csv", odd))
    assert "no action column" in errors(app)[0]
    app.multiselect(key="map_observations").set_value(["left", "right"])
    app.multiselect(key="map_actions").set_value(["move"])
    app.selectbox(key="map_episode").set_value("run")
    app.selectbox(key="map_step").set_value("t")
    next(b for b in app.button if b.label == "Read with these columns").click().run()
    assert not app.exception
    assert not errors(app)
    shown = metrics(app)
    assert (shown["Steps"], shown["Episodes"], shown["Features"]) == ("5", "2", "2")


def test_a_map_without_actions_is_refused() -> None:
    odd = csv_bytes(*ROWS, header="run,t,left,right,move")
    app = upload(open_page("demonstrations", data="pendulum"), ("odd.csv", odd))
    app.multiselect(key="map_actions").set_value([])
    next(b for b in app.button if b.label == "Read with these columns").click().run()
    assert not app.exception
    assert "no actions" in errors(app)[0]


def test_names_come_from_the_environment() -> None:
    rows = "\n".join("0.1;0.2;0.3;0.4;1" if i % 2 else "0.4;0.3;0.2;0.1;0" for i in range(9))
    file = ("o0;o1;o2;o3;action\n" + rows).encode()
    app = open_page("demonstrations")
    app.selectbox(key="upload_env").set_value("CartPole-v1").run()
    upload(app, ("cart.csv", file))
    assert not errors(app)
    assert "pole angle" in texts(app)


def test_an_unknown_environment_is_said() -> None:
    app = open_page("demonstrations", upload_env="Nowhere-v9")
    upload(app, ("mine.csv", csv_bytes(*ROWS)))
    assert not app.exception
    assert "Nowhere-v9" in errors(app)[0]


def test_without_an_upload_the_page_says_what_to_do() -> None:
    app = open_page("demonstrations", data="upload")
    assert "Upload a file above" in texts(app)
    assert not app.metric


def test_odd_data_are_remarked_on() -> None:
    rows = [f"0,{i},1.0,{i % 3},0" for i in range(6)]
    app = upload(open_page("demonstrations"), ("odd.csv", csv_bytes(*rows, header=HEADER)))
    assert not errors(app)
    assert "obs_x" in texts(app) or "'x'" in texts(app)
    assert ":material/info:" in texts(app)


def test_many_features_are_searched_and_shown_a_page_at_a_time() -> None:
    rng = np.random.default_rng(0)
    file = npz_bytes(observations=rng.normal(size=(50, 300)), actions=rng.integers(0, 2, 50))
    app = upload(open_page("demonstrations"), ("wide.npz", file))
    assert not errors(app)

    def drawn() -> list[str]:
        titles = [text.value for text in app.markdown]
        return [title.strip("*") for title in titles if title.startswith("**feature")]

    assert drawn() == [f"feature {place}" for place in range(12)]
    app.session_state["feature_page"] = 25
    app.run()
    assert drawn() == [f"feature {place}" for place in range(288, 300)]
    app.text_input(key="feature_search").set_value("FEATURE 29 E").run()
    assert not app.exception
    # Another list is seen from its beginning.
    matching = [place for place in range(300) if "29" in str(place)]
    assert drawn() == [f"feature {place}" for place in matching[:12]]
    assert len(app.dataframe[-1].value) == len(matching) == 13
    linked = open_page(
        "demonstrations",
        data=app.query_params["data"],
        feature_search="FEATURE 29 E",
        feature_page="2",
    )
    assert f"**feature {matching[12]}**" in [text.value for text in linked.markdown]
    assert f"**feature {matching[0]}**" not in [text.value for text in linked.markdown]
    app.text_input(key="feature_search").set_value("no such thing").run()
    assert not app.exception
    assert not drawn()
    assert "No feature has such a name" in texts(app)


def test_few_features_are_shown_together() -> None:
    app = open_page("demonstrations", data="cartpole")
    assert "feature_search" not in [box.key for box in app.text_input]
    assert "feature_page" not in app.session_state


def test_several_action_dimensions_are_coloured_by_one_of_them() -> None:
    rng = np.random.default_rng(0)
    file = npz_bytes(
        observations=rng.normal(size=(60, 2)), actions=rng.normal(size=(60, 2)).astype("f4")
    )
    app = upload(open_page("demonstrations"), ("two.npz", file))
    assert not errors(app)
    app.selectbox(key="colour").set_value(1).run()
    assert not app.exception
    assert metrics(app)["Actions"] == "2"


def test_the_chosen_set_is_offered_for_download() -> None:
    app = open_page("demonstrations", data="cartpole")
    assert [button.label for button in app.download_button] == [
        "Download as Parquet",
        "Download as CSV",
    ]


def test_markdown_in_names_is_text() -> None:
    frame = pd.DataFrame(
        {"episode": 0, "obs_*x*": [0.0, 1.0, 2.0], "obs_$y$": [1.0, 0.5, 0.1], "action": [0, 1, 0]}
    )
    app = upload(open_page("demonstrations"), ("odd.csv", frame.to_csv(index=False).encode()))
    assert not errors(app)
    assert any("\\*x\\*" in part.value for part in app.markdown)


def test_a_name_becomes_no_link_and_no_emoji() -> None:
    frame = pd.DataFrame(
        {"obs_http://e.com": [0.0, 1.0, 2.0], "obs_:tada:": [1.0, 0.5, 0.1], "action": [0, 1, 0]}
    )
    frame["obs_www.e.com a@e.com"] = [0.5, 0.2, 0.1]
    app = upload(open_page("demonstrations"), ("odd.csv", frame.to_csv(index=False).encode()))
    assert not errors(app)
    words = texts(app)
    for link in ("http://", ":tada:", "www.e", "a@e"):
        assert link not in words
    assert "e.com" in words


def test_a_set_survives_the_change_of_page(tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("sets") / "small.parquet"
    save_demonstrations(
        Demonstrations(np.array([[0.0], [1.0], [2.0]]), np.array([0, 1, 1]), np.zeros(3)), path
    )
    app = upload(open_page("demonstrations"), ("small.parquet", path.read_bytes()))
    app.switch_page("replay.py").run()
    assert not app.exception
    app.switch_page("demonstrations.py").run()
    assert metrics(app)["Steps"] == "3"


def test_whatever_reading_raises_nothing_that_was_chosen_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    app = upload(open_page("demonstrations", data="pendulum"), ("mine.csv", csv_bytes(*ROWS)))
    for error in (MemoryError(), ZeroDivisionError("\x00" * 999)):

        def fail(*given: object, error: Exception = error, **named: object) -> None:
            raise error

        monkeypatch.setattr("sarl_core.demonstrations.formats.registry._read", fail)
        monkeypatch.setattr("sarl_core.demonstrations.formats.registry.unpacked", fail)
        app = upload(app, ("other.csv", csv_bytes(*ROWS)))
        assert not app.exception
        (told,) = errors(app)
        assert told.startswith("other.csv: it cannot be read")
        assert type(error).__name__ in told
        assert metrics(app)["Steps"] == "5"
