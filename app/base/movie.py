"""Where finished frames go: a film (MP4, GIF or animated WebP), which ffmpeg encodes as frames come, or a folder of
numbered PNGs that can be resumed."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import files
from .atomic import atomic_output, check_writable
from .errors import UserError
from .image_io import SHOWN_SUFFIXES, SUFFIXES, check_side, png_bytes
from .locks import locked

MANIFEST = "animation.json"


@dataclass(frozen=True)
class FilmFormat:
    """A kind of animation that is one file."""

    title: str
    encoder: str
    """Arguments of ffmpeg."""
    highest_rate: float = math.inf
    """Frames a second; browsers slow down films whose frames are shown more briefly."""
    largest_side: int | None = None
    """Pixels that it can say."""


FILMS = {
    # Players want even sides; an odd one gets a black line. The colour space is named, so that colours come out as they
    # went in.
    ".mp4": FilmFormat(
        "Movie (MP4)",
        "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv -c:v libx264 -preset medium "
        "-crf 16 -pix_fmt yuv420p -colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 "
        "-movflags +faststart -f mp4",
    ),
    # 256 colours chosen for each frame, dithered.
    ".gif": FilmFormat(
        "GIF",
        "-lavfi split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=floyd_steinberg "
        "-loop 0 -f gif",
        highest_rate=50.0,
    ),
    ".webp": FilmFormat(
        "Animated WebP",
        "-c:v libwebp_anim -quality 90 -compression_level 4 -pix_fmt yuv420p -loop 0 -f webp",
        highest_rate=90.0,
        largest_side=16383,
    ),
}
"""By suffix; every list of film formats that a user meets follows from it."""
_CLAIM = ".claim"
_DIGITS = 4
_PNG_BEGIN, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"


class Film:
    """A movie, GIF or animated WebP, encoded by the ffmpeg that `imageio-ffmpeg` brings; appears when it is closed, and
    cannot be resumed."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Raises `UserError` where the place cannot be written, the format holds no such size, or there is no
        ffmpeg."""
        import subprocess

        check_film(path, size)
        self._path, self._size = path, size
        self._output = atomic_output(path)
        temporary = self._output.__enter__()
        # A process group of its own: Ctrl-C is meant for this program, which then finishes the film.
        self._process = subprocess.Popen(
            [_ffmpeg(), *_arguments(path.suffix.lower(), size, fps), "-y", str(temporary)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        self.frames = 0

    def has(self, index: int) -> bool:
        """False: a film cannot be resumed."""
        return False

    @contextmanager
    def claimed(self, index: int) -> Iterator[bool]:
        """True within the block: nobody else writes this film."""
        yield True

    def write(self, index: int, codes: np.ndarray) -> None:
        """Append a frame. Raises `UserError` when ffmpeg has stopped, ValueError where `codes` is no frame."""
        width, height = self._size
        if codes.shape != (height, width, 3) or codes.dtype != np.uint8:
            raise ValueError(f"a frame is uint8 {(height, width, 3)}, got {codes.dtype} {codes.shape}")
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(codes).data)
        except OSError as error:
            raise self._given_up() from error
        self.frames += 1

    def close(self) -> None:
        """Finish the file; without a frame nothing appears. Raises `UserError` when ffmpeg has failed."""
        if self._process.returncode is not None:
            return
        if not self.frames:
            self._given_up()
            return
        _, log = self._process.communicate()
        if self._process.returncode:
            raise self._given_up(log)
        self._output.__exit__(None, None, None)

    def _given_up(self, log: bytes | None = None) -> UserError:
        """Leave nothing behind; what is to be said about it."""
        if log is None:
            _, log = self._process.communicate()
        stop = UserError(f"cannot write {self._path}: {_last_line(log)}")
        self._output.__exit__(UserError, stop, None)
        return stop


class Frames:
    """A folder of `0000.png`, …: of an animation's frames, or of a sweep's pictures. Those that are there are kept when
    the same work goes on, and several processes may fill it together: each frame is made by one of them, and all that
    are for looking at share one exposure.

    Who makes a frame holds a lock on it, which ends with the process, however that ends. Where there are no locks a
    frame may be made twice, to the same picture."""

    def __init__(
        self,
        folder: Path,
        description: Mapping[str, object],
        overwrite: bool = False,
        manifest: str = MANIFEST,
        suffix: str = ".png",
    ) -> None:
        """`description` says what is drawn and is kept in the file `manifest`: a folder with frames of anything else is
        refused, or emptied of them by `overwrite`."""
        if folder.exists() and not folder.is_dir():
            raise UserError(f"cannot write {folder}: it is a file; give a folder, or a name that ends in .mp4")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot write {folder}: {error.strerror}; choose another place") from error
        check_writable(folder / f"frame{suffix}")
        self._folder, self._manifest, self._suffix = folder, folder / manifest, suffix
        self.shares_exposure = suffix in SHOWN_SUFFIXES
        self.description = json.loads(json.dumps(dict(description)))
        self.base_ev: float | None = None
        with locked(folder):
            self._begin(overwrite)

    def _begin(self, overwrite: bool) -> None:
        folder = self._folder
        if overwrite:
            self._empty()
        stored = self._stored()
        if stored is None and any(folder.glob(f"*{self._suffix}")):
            raise UserError(
                f"{folder} holds pictures of something else: choose another folder, or replace its frames with "
                "--overwrite"
            )
        if stored is not None:
            self.base_ev = _exposure(stored.pop("base_ev", None))
            if stored != self.description:
                raise UserError(
                    f"{folder} holds frames of another {self._manifest.stem}: choose another folder, or replace them "
                    "with --overwrite"
                )
        self._save()

    def fix_exposure(self, base_ev: float) -> float:
        """Remember the exposure that all frames share, also for a later call that goes on; returns the one that
        another process has fixed meanwhile, where one has."""
        with locked(self._folder):
            if self.exposure() is None:
                self.base_ev = base_ev
                self._save()
        assert self.base_ev is not None
        return self.base_ev

    def exposure(self) -> float | None:
        """What was fixed, by whomever; None before."""
        if self.base_ev is None:
            self.base_ev = _exposure((self._stored() or {}).get("base_ev"))
        return self.base_ev

    def has(self, index: int) -> bool:
        """Whether the frame is there."""
        return (self.exposure() is not None or not self.shares_exposure) and _is_whole(self.path(index))

    @contextmanager
    def claimed(self, index: int) -> Iterator[bool]:
        """Within the block: whether the frame is the caller's to make, being neither there nor in another's hands."""
        claim = self._folder / f".{index:0{_DIGITS}}{_CLAIM}"
        if self.has(index):
            yield False
            return
        with locked(claim, wait=False) as is_ours:
            # Another may have finished it between the two looks.
            yield is_ours and not self.has(index)
            if is_ours:
                claim.unlink(missing_ok=True)

    def path(self, index: int) -> Path:
        """The file of a frame."""
        return self._folder / frame_name(index, self._suffix)

    def write(self, index: int, codes: np.ndarray) -> None:
        """Write a frame, whole or not at all."""
        self.write_png(index, png_bytes(codes))

    def write_png(self, index: int, png: bytes) -> None:
        """The same of a frame that `png_bytes` has made elsewhere."""
        with atomic_output(self.path(index)) as temporary:
            temporary.write_bytes(png)

    def read(self, index: int) -> np.ndarray:
        """A frame that is there: uint8 (H, W, 3). Raises `UserError` where it is damaged."""
        from PIL import Image

        try:
            with Image.open(self.path(index)) as image:
                return np.asarray(image.convert("RGB"))
        except (OSError, ValueError, SyntaxError) as error:
            raise UserError(f"{self.path(index)} is damaged ({error}): remove it, and it is made again") from error

    def close(self) -> None:
        """Remove the claims of processes that were killed."""
        for claim in self._folder.glob(f".*{_CLAIM}"):
            with suppress(OSError), locked(claim, wait=False, make=False) as is_ours:
                if is_ours:
                    claim.unlink(missing_ok=True)

    def _stored(self) -> dict | None:
        try:
            stored = json.loads(files.read_text(self._manifest, files.TABLE_BYTES))
        except (OSError, ValueError, RecursionError):
            return None
        return stored if isinstance(stored, dict) else None

    def _save(self) -> None:
        with atomic_output(self._manifest) as temporary:
            temporary.write_text(
                json.dumps(self.description | {"base_ev": self.base_ev}, indent=1) + "\n", encoding="utf-8"
            )

    def _empty(self) -> None:
        """Remove the frames that were made here before, and nothing else."""
        if self._stored() is not None:
            for frame in self._folder.iterdir():
                if frame.stem.isdigit() and frame.suffix in SUFFIXES:
                    frame.unlink()
        self._manifest.unlink(missing_ok=True)


Sink = Film | Frames
"""Takes frames in their order."""


def frame_name(index: int, suffix: str) -> str:
    """What a frame's file is called."""
    return f"{index:0{_DIGITS}}{suffix}"


def _exposure(value: object) -> float | None:
    """A manifest's exposure; None, which draws all frames again, for what is none."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else None  # type: ignore[arg-type]


def _is_whole(path: Path) -> bool:
    """Whether the file is there and, where it is a PNG, begins and ends as one: a power cut may leave it empty or
    cut."""
    try:
        files.check_regular(path, files.DATA_BYTES)
        if path.suffix != ".png":
            return path.stat().st_size > 0
        with path.open("rb") as file:
            begins = file.read(len(_PNG_BEGIN)) == _PNG_BEGIN
            file.seek(-len(_PNG_END), os.SEEK_END)
            return begins and file.read() == _PNG_END
    except OSError:
        return False


def _arguments(suffix: str, size: tuple[int, int], fps: float) -> list[str]:
    kind = FILMS[suffix]
    rate = min(fps, kind.highest_rate)
    source = f"-loglevel error -f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -r {rate:g} -i -"
    return [*source.split(), *kind.encoder.split()]


def _ffmpeg() -> str:
    import imageio_ffmpeg

    try:
        return imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise UserError(
            "no ffmpeg was found to write a film: install one, or give a folder for a sequence of PNGs"
        ) from error


def _last_line(log: bytes) -> str:
    lines = [line for line in log.decode(errors="replace").splitlines() if line.strip()]
    return f"ffmpeg says '{lines[-1].strip()}'" if lines else "ffmpeg ended without a word (is the disk full?)"


def open_sink(
    path: Path, size: tuple[int, int], fps: float, description: Mapping[str, object], overwrite: bool = False
) -> Sink:
    """The sink that `path` asks for: one of `FILMS`, or a folder (a name without a suffix). Raises
    `UserError`."""
    if path.suffix.lower() in FILMS:
        return Film(path, size, fps)
    check_folder(path)
    return Frames(path, description, overwrite)


def check_folder(path: Path) -> None:
    """Raise `UserError` where `path` looks like a file's name."""
    if path.suffix and not os.path.isdir(path):
        raise UserError(
            f"cannot write {path}: the suffix '{path.suffix}' is not an animation; use {', '.join(FILMS)}, or "
            "a folder for PNGs"
        )


def check_film(path: Path, size: tuple[int, int]) -> None:
    """Raise `UserError` where the film `path` of pictures of `size` could not be written at the end."""
    kind = FILMS.get(path.suffix.lower())
    check_side(path, size, kind.largest_side if kind else None)
    check_writable(path)
