"""Keeping many pictures in little memory: palette indexes, compressed as they come."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import WorkError

Colour = tuple[int, int, int]

TRANSPARENT = 255  # in a GIF: this pixel stays as it was
_UNKNOWN = 255

# (entries in use, squared distance): a new colour gets an entry of its own while there is room,
# and the fuller the palette, the more it has to differ from those that are there. So the many
# shades along smoothed edges do not take the room of a flame that appears later.
_PATIENCE = ((128, 0), (176, 3 * 6**2), (224, 3 * 14**2), (TRANSPARENT, 3 * 28**2))
_WHOLE_EVERY = 50  # pictures; one in between is put together from at most as many
_COLOURS_AT_ONCE = 96  # of a picture with more new colours than there is room for


class Palette:
    """At most 255 colours that all pictures share; it grows as new ones come.

    The same pictures in the same order always give the same palette. There is no dithering.
    """

    def __init__(self, reserved: Sequence[Colour] = ()) -> None:
        """Start a palette.

        Args:
            reserved: The first entries; pictures may use them too.
        """
        self._colours = np.zeros((TRANSPARENT, 3), dtype=np.int32)
        self._used = 0
        self._index_of = np.full(1 << 24, _UNKNOWN, dtype=np.uint8)
        for colour in reserved:
            self._add(np.array(colour, dtype=np.int32))

    @property
    def colours(self) -> NDArray[np.uint8]:
        """All colours, shape (n, 3)."""
        return self._colours[: self._used].astype(np.uint8)

    def indexes(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The palette's index of every pixel.

        Args:
            picture: Shape (height, width, 3).

        Returns:
            Shape (height, width).
        """
        padded = np.zeros((*picture.shape[:2], 4), dtype=np.uint8)
        padded[..., :3] = picture
        keys = padded.view("<u4")[..., 0]
        entries = self._index_of[keys]
        unknown = entries == _UNKNOWN
        if unknown.any():
            self._learn(keys[unknown])
            entries = self._index_of[keys]
        return np.asarray(entries)

    def _add(self, colour: NDArray[np.int32]) -> None:
        self._colours[self._used] = colour
        key = int(colour[0]) | int(colour[1]) << 8 | int(colour[2]) << 16
        self._index_of[key] = min(int(self._index_of[key]), self._used)
        self._used += 1

    def _learn(self, keys: NDArray[np.uint32]) -> None:
        """Give every new colour an index, the most frequent first."""
        new, counts = np.unique(keys, return_counts=True)
        order = np.lexsort((new, -counts))
        colours = _channels(new[order])
        if len(colours) > TRANSPARENT - self._used:
            self._offer(_representatives(keys, _COLOURS_AT_ONCE))
        else:
            self._offer(colours)
        known = self._colours[: self._used]
        for start in range(0, len(colours), 4096):
            piece = colours[start : start + 4096]
            distance = ((piece[:, None, :] - known[None]) ** 2).sum(axis=2)
            self._index_of[new[order[start : start + 4096]]] = distance.argmin(axis=1)

    def _offer(self, colours: NDArray[np.int32]) -> None:
        for colour in colours:
            if self._used == TRANSPARENT:
                return
            needed = next(distance for limit, distance in _PATIENCE if self._used < limit)
            known = self._colours[: self._used]
            if not self._used or ((known - colour) ** 2).sum(axis=1).min() > needed:
                self._add(colour)


def _channels(keys: NDArray[np.uint32]) -> NDArray[np.int32]:
    return np.stack([keys & 255, keys >> 8 & 255, keys >> 16 & 255], axis=1).astype(np.int32)


def _representatives(keys: NDArray[np.uint32], count: int) -> NDArray[np.int32]:
    """A few colours that stand for many (Pillow's median cut)."""
    from PIL import Image

    pixels = _channels(keys).astype(np.uint8)[None]
    reduced = Image.fromarray(pixels).quantize(count, method=Image.Quantize.MEDIANCUT)
    entries = np.array(reduced.getpalette(), dtype=np.int32).reshape(-1, 3)[:count]
    shares = np.bincount(np.asarray(reduced).reshape(-1), minlength=len(entries))
    return entries[np.argsort(-shares[: len(entries)], kind="stable")]


class Box(NamedTuple):
    """A rectangle of pixels.

    Attributes:
        rows: From the top.
        columns: From the left.
    """

    rows: slice
    columns: slice


def changed_box(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> Box | None:
    """The smallest rectangle outside which two pictures are equal.

    Args:
        before: Shape (height, width) or (height, width, 3), uint8.
        after: The same shape.

    Returns:
        The rectangle, or None where the pictures are equal.
    """
    height, width = after.shape[:2]
    # Eight bytes at a time where a row divides into as many.
    wide = before.nbytes // height % 8 == 0
    lines = [np.ascontiguousarray(picture).reshape(height, -1) for picture in (before, after)]
    first, second = (line.view(np.uint64) for line in lines) if wide else lines
    rows = np.flatnonzero((first != second).any(axis=1))
    if not len(rows):
        return None
    part = slice(int(rows[0]), int(rows[-1]) + 1)
    differs = (lines[0][part] != lines[1][part]).any(axis=0).reshape(width, -1).any(axis=1)
    columns = np.flatnonzero(differs)
    return Box(part, slice(int(columns[0]), int(columns[-1]) + 1))


class _Patch(NamedTuple):
    """What changed since the picture before; the whole picture where `box` is None."""

    box: Box | None
    compressed: bytes


class Film:
    """Pictures of one size: each as what changed since the one before, a few kilobytes."""

    def __init__(self, palette: Palette) -> None:
        """Start a film.

        Args:
            palette: Several films may share one.
        """
        self.palette = palette
        self._patches: list[_Patch | None] = []
        self._last: tuple[NDArray[np.uint8], NDArray[np.uint8]] | None = None
        self._latest: tuple[int, NDArray[np.uint8]] | None = None

    def __len__(self) -> int:
        """Number of pictures."""
        return len(self._patches)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        if self._last is None:
            raise ValueError("the film is empty")
        height, width = self._last[1].shape
        return height, width

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture.

        Args:
            picture: Shape (height, width, 3), uint8; copied.

        Raises:
            WorkError: If its size differs from the first one's.
        """
        if self._last is None:
            self._keep(picture.copy(), self.palette.indexes(picture), None)
            return
        before, indexes = self._last
        if before.shape != picture.shape:
            raise WorkError(
                f"the environment draws pictures of {before.shape[:2]} and then of "
                f"{picture.shape[:2]} pixels; choose one whose pictures keep their size"
            )
        box = changed_box(before, picture)
        if box is None and len(self) % _WHOLE_EVERY:
            self._patches.append(None)
            return
        if box is not None:
            before[box], indexes[box] = picture[box], self.palette.indexes(picture[box])
        self._keep(before, indexes, box if len(self) % _WHOLE_EVERY else None)

    def _keep(
        self, picture: NDArray[np.uint8], indexes: NDArray[np.uint8], box: Box | None
    ) -> None:
        self._last = picture, indexes
        part = indexes if box is None else indexes[box]
        self._patches.append(_Patch(box, zlib.compress(part.tobytes(), 1)))

    def indexes(self, number: int) -> NDArray[np.uint8]:
        """One picture; fastest in order.

        Args:
            number: Which, from 0.

        Returns:
            Shape (height, width), indexes into the palette; read-only.
        """
        latest = self._latest
        begin, picture = number // _WHOLE_EVERY * _WHOLE_EVERY, None
        if latest is not None and begin <= latest[0] <= number:
            if latest[0] == number:
                return latest[1]
            begin, picture = latest[0] + 1, latest[1].copy()
        for patch in self._patches[begin : number + 1]:
            picture = self._patched(picture, patch)
        assert picture is not None
        picture.flags.writeable = False
        self._latest = number, picture
        return picture

    def _patched(
        self, picture: NDArray[np.uint8] | None, patch: _Patch | None
    ) -> NDArray[np.uint8]:
        if patch is not None:
            values = np.frombuffer(zlib.decompress(patch.compressed), dtype=np.uint8)
            if patch.box is None:
                return values.reshape(self.size).copy()
            assert picture is not None
            picture[patch.box] = values.reshape(picture[patch.box].shape)
        assert picture is not None
        return picture
