import io
from pathlib import Path

import imageio.v3
import numpy as np
import pytest
from PIL import Image, ImageSequence

from sarl_core.errors import InputError, WorkError
from sarl_core.progress import CancelledError
from sarl_core.rendering.film import Film, Palette
from sarl_core.rendering.gif_and_mp4 import encode_gif, encode_mp4, schedule


def scene(number: int, size: tuple[int, int] = (41, 61)) -> np.ndarray:
    """A square that wanders over two fields of colour."""
    picture = np.full((*size, 3), (10, 20, 30), dtype=np.uint8)
    picture[size[0] // 2 :] = (200, 210, 220)
    picture[5 : 5 + 9, number : number + 9] = (213, 94, 0)
    return picture


def read_gif(content: bytes) -> tuple[list[np.ndarray], list[int]]:
    with Image.open(io.BytesIO(content)) as image:
        pairs = [
            (np.asarray(frame.convert("RGB")), int(frame.info["duration"]))
            for frame in ImageSequence.Iterator(image)
        ]
    return [picture for picture, _ in pairs], [duration for _, duration in pairs]


def test_a_gif_gives_back_every_picture_exactly() -> None:
    frames = [scene(number) for number in range(30)]
    pictures, durations = read_gif(encode_gif(frames, 50))
    assert durations == [20] * 30
    assert all((a == b).all() for a, b in zip(pictures, frames, strict=True))


def test_a_gif_of_noise_gives_back_every_picture_exactly() -> None:
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 256, (120, 3)).astype(np.uint8)
    frames = [colours[rng.integers(0, 120, (37, 53))] for _ in range(8)]
    pictures, _ = read_gif(encode_gif(frames, 10))
    assert all((a == b).all() for a, b in zip(pictures, frames, strict=True))


def test_a_gif_repeats_for_ever() -> None:
    with Image.open(io.BytesIO(encode_gif([scene(0), scene(1)], 50))) as image:
        assert image.info["loop"] == 0
        assert image.is_animated  # type: ignore[attr-defined]


def test_equal_pictures_are_shown_longer() -> None:
    pictures, durations = read_gif(encode_gif([scene(0), scene(1), scene(1), scene(1)], 50))
    assert durations == [20, 60]
    assert (pictures[1] == scene(1)).all()


def test_a_picture_can_stay_longer_than_one_delay_allows() -> None:
    frames = [scene(0)] + [scene(1)] * 80
    _, durations = read_gif(encode_gif(frames, 0.1))
    assert sum(durations) == 810_000


@pytest.mark.parametrize("fps", [4, 15, 24, 30, 50, 60, 75, 100, 200, 333])
@pytest.mark.parametrize("count", [1, 2, 7, 100, 501])
def test_a_gif_runs_in_real_time(fps: int, count: int) -> None:
    shown = schedule(count, fps)
    assert abs(sum(delay for _, delay in shown) / 100 - count / fps) <= max(1 / fps, 0.02)
    assert min(delay for _, delay in shown) >= 2
    numbers = [number for number, _ in shown]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == count - 1
    assert fps > 50 or numbers == list(range(count))


def test_thirty_a_second_alternates() -> None:
    assert [delay for _, delay in schedule(6, 30)] == [3, 4, 3, 3, 4, 3]
    assert [delay for _, delay in schedule(4, 50)] == [2, 2, 2, 2]


@pytest.mark.parametrize(("count", "fps"), [(0, 50.0), (5, 0.0), (5, float("nan"))])
def test_nothing_to_show_is_an_error(count: int, fps: float) -> None:
    with pytest.raises(InputError):
        schedule(count, fps)


def test_same_pictures_same_bytes(tmp_path: Path) -> None:
    frames = [scene(number) for number in range(12)]
    assert encode_gif(frames, 50) == encode_gif(frames, 50, tmp_path / "a.gif")
    assert (tmp_path / "a.gif").read_bytes() == encode_gif(frames, 50)
    for name in ("a.mp4", "b.mp4"):
        encode_mp4(frames, 50, tmp_path / name)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gif", "a.mp4", "b.mp4"]


# imageio's reader leaves a pipe to ffmpeg open.
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_an_mp4_can_be_read(tmp_path: Path) -> None:
    frames = [scene(number, (91, 121)) for number in range(40)]
    encode_mp4(frames, 25, tmp_path / "x.mp4")
    pictures = imageio.v3.imread(tmp_path / "x.mp4", plugin="FFMPEG")
    assert pictures.shape == (40, 92, 122, 3)
    assert np.abs(pictures[20, :91, :121].astype(int) - frames[20]).mean() < 8
    data = imageio.v3.immeta(tmp_path / "x.mp4", plugin="FFMPEG")
    assert data["codec"] == "h264"
    assert data["pix_fmt"].startswith("yuv420p")
    assert data["fps"] == 25
    assert data["duration"] == pytest.approx(1.6, abs=0.04)


def test_many_colours_are_reduced_without_dithering() -> None:
    ramp = np.linspace(0, 255, 300).astype(np.uint8)
    frame = np.stack(
        [
            np.repeat(ramp[None], 200, axis=0),
            np.repeat(ramp[:200, None], 300, axis=1),
            np.full((200, 300), 90, np.uint8),
        ],
        axis=2,
    )
    palette = Palette()
    indexes = palette.indexes(frame)
    shown = palette.colours[indexes].astype(int)
    assert len(palette.colours) <= 255
    assert np.abs(shown - frame).mean() < 12
    # One colour always becomes the same index: no dither.
    keys = frame[..., 0].astype(int) * 256 + frame[..., 1]
    pairs = np.unique(np.stack([keys.ravel(), indexes.ravel()]), axis=1)
    assert pairs.shape[1] == len(np.unique(keys))


def test_a_late_colour_still_finds_room() -> None:
    """Many shades of grey come first; a flame that appears later has to stay a flame."""
    palette = Palette()
    for shade in range(0, 250):
        palette.indexes(np.full((2, 2, 3), shade, dtype=np.uint8))
    flame = np.array([[[255, 80, 0]]], dtype=np.uint8)
    indexes = palette.indexes(flame)
    assert (palette.colours[indexes] == flame).all()


def test_a_film_gives_back_what_it_was_given() -> None:
    film = Film(Palette())
    frames = [scene(number // 2) for number in range(20)]
    for frame in frames:
        film.add(frame)
    assert len(film) == 20
    for number in (0, 7, 8, 19):
        assert (film.palette.colours[film.indexes(number)] == frames[number]).all()
    with pytest.raises(WorkError, match="keep their size"):
        film.add(scene(0, (50, 61)))


def test_encoding_can_be_stopped(tmp_path: Path) -> None:
    frames = [scene(number) for number in range(12)]
    with pytest.raises(CancelledError):
        encode_gif(frames, 50, tmp_path / "x.gif", progress=lambda *_: False)
    with pytest.raises(CancelledError):
        encode_mp4(frames, 50, tmp_path / "x.mp4", progress=lambda *_: False)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_or_no_picture_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        encode_gif([scene(0)], 50, tmp_path / "no" / "x.gif")
    with pytest.raises(InputError, match="no picture"):
        encode_mp4([], 50, tmp_path / "x.mp4")
    assert list(tmp_path.iterdir()) == []
