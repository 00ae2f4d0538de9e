"""Pictures to GIF and MP4 files, at the speed of the environment."""

from __future__ import annotations

import io
import shutil
import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError, WorkError
from sarl_core.files import whole_file
from sarl_core.progress import Progress, report
from sarl_core.rendering.film import TRANSPARENT, Film, Palette, changed_box

_LEAST_DELAY = 2  # hundredths of a second; browsers show anything shorter for a tenth
_LONGEST_DELAY = 65_535
_LITTLE_SPACE = 2**20  # bytes; less than any film of ours takes while it is made
# A fixed number of threads and no date: the same pictures give the same bytes.
_MP4 = (
    "-crf",
    "20",
    "-preset",
    "veryfast",
    "-threads",
    "2",
    "-movflags",
    "+faststart",
    "-fflags",
    "+bitexact",
    "-flags:v",
    "+bitexact",
    "-map_metadata",
    "-1",
)


class TimedPicture(NamedTuple):
    """A picture of an animation.

    Attributes:
        number: Which picture.
        delay: How long it is shown, in hundredths of a second.
    """

    number: int
    delay: int


def schedule(count: int, fps: float) -> tuple[TimedPicture, ...]:
    """When to show which picture of a GIF, whose delays are hundredths of a second.

    Delays alternate where the rate does not divide 100 (30 a second: 3, 4, 3), so that the
    whole is right. Above 50 a second pictures are left out, never the last.

    Args:
        count: Number of pictures.
        fps: Pictures a second.

    Returns:
        The pictures that are shown, in order.

    Raises:
        InputError: If there is no picture or no speed.
    """
    if count < 1 or not fps > 0:
        raise InputError(
            "there is no picture to show; render at least one"
            if count < 1
            else f"{fps} pictures a second cannot be shown; give a number above 0"
        )
    starts = [int(100 * number / fps + 0.5) for number in range(count + 1)]
    numbers = [0]
    for number in range(1, count):
        if starts[number] - starts[numbers[-1]] >= _LEAST_DELAY:
            numbers.append(number)
    if len(numbers) > 1 and starts[count] - starts[numbers[-1]] < _LEAST_DELAY:
        numbers.pop()
    ends = [starts[number] for number in numbers[1:]] + [starts[count]]
    delays = [end - starts[number] for number, end in zip(numbers, ends, strict=True)]
    numbers[-1] = count - 1
    return tuple(
        TimedPicture(number, min(max(delay, _LEAST_DELAY), _LONGEST_DELAY))
        for number, delay in zip(numbers, delays, strict=True)
    )


def gif_bytes(
    count: int,
    indexes: Callable[[int], NDArray[np.uint8]],
    colours: NDArray[np.uint8],
    fps: float,
    *,
    progress: Progress | None = None,
) -> bytes:
    """Encode pictures that share a palette; each holds only what changed since the one before.

    Args:
        count: Number of pictures.
        indexes: Gives picture i, (height, width) indexes into the palette; asked in order.
        colours: The palette, shape (n, 3), n at most 255.
        fps: Pictures a second.
        progress: Called with (pictures done, in all).

    Returns:
        An endless GIF.

    Raises:
        InputError: If there is nothing to show.
        CancelledError: If `progress` returned False.
    """
    timed = schedule(count, fps)
    first = indexes(timed[0].number)
    height, width = first.shape
    table = np.zeros((256, 3), dtype=np.uint8)
    table[: len(colours)] = colours
    out = io.BytesIO()
    out.write(b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0) + table.tobytes())
    out.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # again and again
    before, waiting, delay = first, (first, 0, 0), timed[0].delay
    for done, (number, next_delay) in enumerate(timed[1:], start=1):
        picture = indexes(number)
        change = _change(before, picture)
        if change is None and delay + next_delay <= _LONGEST_DELAY:
            delay += next_delay
        else:
            _write_picture(out, *waiting, delay)
            waiting, delay = change or (picture[:1, :1], 0, 0), next_delay
        before = picture
        report(progress, done, len(timed))
    _write_picture(out, *waiting, delay)
    out.write(b"\x3b")
    report(progress, len(timed), len(timed))
    return out.getvalue()


def _change(
    before: NDArray[np.uint8], after: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], int, int] | None:
    """The part that changed, with what stayed in it made transparent, and its left and top."""
    box = changed_box(before, after)
    if box is None:
        return None
    changed = np.where(before[box] != after[box], after[box], np.uint8(TRANSPARENT))
    return changed, box.columns.start, box.rows.start


def _write_picture(
    out: io.BytesIO, part: NDArray[np.uint8], left: int, top: int, delay: int
) -> None:
    height, width = part.shape
    # Leave the picture in place afterwards (1 << 2), and one index is transparent (1).
    out.write(b"\x21\xf9\x04" + struct.pack("<BHBB", 1 << 2 | 1, delay, TRANSPARENT, 0))
    out.write(b"\x2c" + struct.pack("<HHHHB", left, top, width, height, 0))
    from PIL import Image

    # LZW with codes from 8 bits on, as one chain of blocks; Pillow's encoder writes these.
    blocks = Image.fromarray(np.ascontiguousarray(part)).tobytes("gif", "L", 8, 0)
    out.write(b"\x08" + blocks + b"\x00")


def encode_gif(
    frames: Iterable[NDArray[np.uint8]],
    fps: float,
    path: str | Path | None = None,
    *,
    progress: Progress | None = None,
) -> bytes:
    """Encode pictures as a GIF with one palette and without dithering.

    Args:
        frames: Pictures of one size, (height, width, 3) uint8.
        fps: Pictures a second; it runs at that speed (see `schedule`).
        path: File to write as well; it appears whole or not at all.
        progress: Called with (pictures done, in all).

    Returns:
        The file's content; the same pictures give the same bytes.

    Raises:
        InputError: If there is nothing to show, or the folder does not exist.
        WorkError: If the pictures differ in size.
    """
    film = Film(Palette())
    for frame in frames:
        film.add(frame)
    content = gif_bytes(len(film), film.indexes, film.palette.colours, fps, progress=progress)
    if path is not None:
        with whole_file(Path(path)) as unfinished:
            unfinished.write_bytes(content)
    return content


def encode_mp4(
    frames: Iterable[NDArray[np.uint8]],
    fps: float,
    path: str | Path,
    *,
    count: int | None = None,
    progress: Progress | None = None,
) -> None:
    """Encode pictures as MP4 (H.264, yuv420p), which every browser plays.

    Args:
        frames: Pictures of one size, (height, width, 3) uint8; an odd side is made even by
            repeating its last row or column.
        fps: Pictures a second.
        path: File to write; it appears whole or not at all.
        count: Number of pictures, for `progress`.
        progress: Called with (pictures done, in all).

    Raises:
        InputError: If there is nothing to show, or the folder does not exist.
        WorkError: If the encoder fails, or what it wrote cannot be played.
    """
    with whole_file(Path(path)) as unfinished:
        done = 0
        writer = None
        try:
            for frame in frames:
                height, width = frame.shape[:2]
                even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
                if writer is None:
                    writer = _open_mp4(unfinished, fps)
                writer.append_data(np.ascontiguousarray(even))
                done += 1
                report(progress, done, count or done)
        except OSError as error:
            raise _not_encoded(Path(path)) from error
        finally:
            if writer is not None:
                writer.close()
        if not done:
            raise InputError("there is no picture to show; render at least one")
        if _pictures_in(unfinished) != done:
            raise _not_encoded(Path(path))


def _open_mp4(path: Path, fps: float) -> Any:
    """A writer of imageio that takes pictures."""
    import imageio.v2

    return imageio.v2.get_writer(
        path,
        format="FFMPEG",
        fps=fps,
        codec="libx264",
        pixelformat="yuv420p",
        macro_block_size=2,
        quality=None,
        ffmpeg_log_level="quiet",  # what went wrong is told in a sentence of ours
        output_params=list(_MP4),
    )


def _pictures_in(path: Path) -> int:
    """How many pictures a film shows, 0 where no player opens it.

    The encoder is another process and tells nobody how it ended; on a full disk it leaves a file
    behind. So what it wrote is read.
    """
    from imageio_ffmpeg import count_frames_and_secs

    try:
        return int(count_frames_and_secs(path)[0])
    except (OSError, RuntimeError):
        return 0


def _not_encoded(path: Path) -> WorkError:
    free = shutil.disk_usage(path.parent).free
    if free < _LITTLE_SPACE:
        return WorkError(
            f"{path} could not be encoded: {free / 2**20:.1f} MB are left in its folder; "
            "free some space or choose another place"
        )
    return WorkError(f"{path} could not be encoded; try a .gif, or another place")
