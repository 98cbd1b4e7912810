"""Groups of pictures that are done are kept in a folder, so that an encode that was killed can be resumed.

A folder belongs to one encode: `ABOUT` in it states the source, the settings and the code, and any other encode is
refused. Each group has a file, named by the number of its first frame, which has its name only when it is complete and
on the disk. A file is used only if it says that it is this group of this folder, and if the source of each of its
frames still has the same digest. `OwnFolder` checks whose folder it is, and does all reading and writing in it.
"""

import json
import secrets
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.folders import OwnFolder, UnusableFileError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.encoder.encoded_frame import EncodedFrame
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.encoder.loop import GroupCoder, described, encode_frame
from gsvc_ref.encoder.recording import NothingSavedError
from gsvc_ref.encoder.report import ProgressReporter
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.video import VideoFormat
from gsvc_tools.jobs.code_version import code_version
from gsvc_tools.jobs.kept_group import GroupWriter, KeptGroup

ABOUT: Final = "encode.json"
"""The file that says which encode a folder is of."""

LOCK: Final = "lock"
"""The file that is locked while an encode uses the folder."""

MARK: Final = "mark"
"""The member of ABOUT that each of its groups repeats: a random text."""

MAX_GROUP: Final = 1 << 30
"""Maximum number of bytes of a group that is kept."""

SHORT: Final = 40
"""Maximum length of the values of a setting that are named if they differ."""

IGNORED_SETTINGS: Final = ("threads",)
"""Settings that the bytes do not depend on."""


class ChangedSourceError(NothingSavedError):
    """The source has other frames than the encode that is resumed, whose target stays as it is."""


def about_encode(video: VideoFormat, settings: Settings) -> dict[str, Any]:
    """What must be equal for an encode to resume another, as values of JSON."""
    compared = {name: value for name, value in asdict(settings).items() if name not in IGNORED_SETTINGS}
    about = {"code": code_version(), "source": asdict(video), "settings": compared}
    data: dict[str, Any] = json.loads(json.dumps(about, default=str))
    return data


class Keeper:
    """The folder of an encode.

    Parameters
    ----------
    folder
        It is made if it does not exist.
    about
        What `about_encode` says.

    Attributes
    ----------
    header
        Tells the sequence header of the encode, which sets it; asked for when the first frame is encoded.
    is_sound
        Tells whether the source has had no fault; otherwise its last group may have more frames another time.
    notes
        Sentences on what was taken from the folder, and on what could not be kept.

    Raises
    ------
    UsageError
        It is of another encode, or another encode is using it.
    OSError
        It cannot be made or written.
    """

    header: Callable[[], SequenceHeader]

    def __init__(self, folder: Path, about: dict[str, Any]) -> None:
        self.folder = folder
        self.is_sound: Callable[[], bool] = lambda: True
        self.frames = self.groups = 0
        self._faults: list[str] = []
        self._ours: set[str] = set()
        self._is_full = self._is_removed = False
        try:
            self._files = OwnFolder(folder, ABOUT, lock=LOCK)
        except BlockingIOError:
            raise UsageError(f"another encode keeps its groups in {folder}: wait for its end, or end it") from None
        try:
            self.mark = self._check(about)
        except OSError:
            self.close()
            raise
        except BaseException:
            self._files.close()
            raise

    def _check(self, about: dict[str, Any]) -> str:
        """Refuse a folder of another encode, or describe this one in a new folder; returns the mark of the folder."""
        try:
            before, is_intact = self._files.record(ABOUT)
            changed = _changes(before, about)
            mark = before.get(MARK)
            if not changed and not (is_intact and isinstance(mark, str)):
                raise ValueError
        except FileNotFoundError:
            mark = secrets.token_hex(16)
            self._files.write_record(ABOUT, {**about, MARK: mark}, durable=True)
            return mark
        except (ValueError, TypeError, KeyError, AttributeError, UnusableFileError):
            changed = [f"{self.folder / ABOUT} cannot be read"]
        if changed:
            raise UsageError(
                f"{self.folder} is of another encode ({'; '.join(changed[:3])}): encode as before, or remove the "
                "folder to begin anew"
            )
        assert isinstance(mark, str)
        return mark

    def group(self, first: int) -> "GroupInWork":
        """The group that begins with a frame."""
        return GroupInWork(self, first)

    def read(self, first: int) -> KeptGroup | None:
        """The group that was kept; None if there is none. One that is damaged is encoded again."""
        name = _name(first)
        try:
            data = self._files.read(name, MAX_GROUP)
            self._ours.add(name)
            kept = KeptGroup(data)
        except FileNotFoundError:
            return None
        except (GsvcError, UsageError, OSError) as error:
            self.refuse(first, f"cannot be read, so its frames were encoded again: {error}")
            return None
        quantizers = {
            name: getattr(kept.header, name) for name in ("cholesky_bits", "color_stages", "color_codewords")
        }  # they may be chosen on the first frame
        if replace(self.header(), frame_count=kept.header.frame_count, **quantizers) != kept.header:
            self.refuse(first, "is of another stream, so its frames were encoded again")
        elif kept.place != (self.mark, first):
            self.refuse(first, "holds another group of pictures than its name says, so its frames were encoded again")
        else:
            return kept
        return None

    def refuse(self, first: int, why: str) -> None:
        """Note why a group that was kept is not taken."""
        self._faults.append(f"{self.folder / _name(first)} {why}")

    def write(self, first: int, data: bytes) -> None:
        """Keep a group; if that fails, as on a full disk, no more are kept, and the encode goes on."""
        if self._is_full:
            return
        name = _name(first)
        try:
            if len(data) > MAX_GROUP:
                raise UnusableFileError(
                    f"{self.folder / name} would have {len(data)} bytes; at most {MAX_GROUP} are kept"
                )
            self._ours.add(name)  # before it is, so that an interrupt leaves none
            self._files.write(name, data, durable=True)
        except UnusableFileError as error:
            self._ours.discard(name)
            self._faults.append(f"the group from frame {first} on could not be kept: {error}")
        except OSError as error:
            self._is_full = True
            reason = error.strerror or str(error)
            self._faults.append(
                f"groups from frame {first} on could not be kept in {self.folder} ({reason}): if this encode is ended, "
                "they are encoded again"
            )

    @property
    def notes(self) -> list[str]:
        """Sentences on what was taken from the folder, and on what could not be kept."""
        taken = []
        if self.frames:
            groups = "1 group" if self.groups == 1 else f"{self.groups} groups"
            taken = [f"{self.frames} frames in {groups} of pictures were taken from {self.folder}"]
        return taken + self._faults

    def close(self) -> None:
        """Let other encodes use the folder, which goes if nothing was kept."""
        if not self._is_removed and {ABOUT, LOCK}.issuperset(self._files.names()):
            self.remove()
        self._files.close()

    def remove(self) -> None:
        """Remove what this encode kept or took, and the folder, if nothing else is in it."""
        for name in (*sorted(self._ours), ABOUT):
            with suppress(OSError):  # a folder has the name now
                self._files.remove(name)
        self._files.remove_folder()
        self._is_removed = True


def _name(first: int) -> str:
    """The name of the file of a group."""
    return f"{first:08}.gsvc"


class GroupInWork:
    """A group of pictures whose frames were kept, or are to be kept when all of them are encoded.

    Attributes
    ----------
    first
        The number of its first frame.
    kept
        The group that was kept; None: it is to be encoded.
    """

    def __init__(self, keeper: Keeper, first: int) -> None:
        self.first, self._keeper = first, keeper
        self.kept = keeper.read(first)
        self._digests: list[str] = []
        self._writer: GroupWriter | None = None
        self._encoded = 0
        self._decided: tuple[int, ...] = ()
        self._is_whole = self._is_at_fault = False

    def decide(self, coder: GroupCoder) -> bool:
        """Let a coder know what the first frame decided, if this group has it and was kept."""
        if self.kept is None:
            return False
        try:
            coder.decide(self.kept.decided)
        except ValueError as error:  # also a UsageError
            self._keeper.refuse(self.first, f"cannot be read, so its frames were encoded again: {error}")
            self.kept = None
            return False
        return True

    def take(self, frame: Frame) -> tuple[EncodedFrame, float] | None:
        """Take the next frame of the source: how it was encoded, in which time; None if it is to be encoded.

        Raises
        ------
        ChangedSourceError
            The frames that were kept are of another source.
        """
        number, digest = len(self._digests), digest_of(frame)
        self._digests.append(digest)
        if self.kept is None:
            return None
        if number >= len(self.kept.digests) or self.kept.digests[number] != digest:
            raise self._changed(number)
        self._keeper.groups += number == 0
        self._keeper.frames += 1
        try:
            return self.kept.next_frame()
        except GsvcError as error:  # its checksums were made to fit
            raise GsvcError(
                "malformed",
                f"what is kept in {self._keeper.folder} is damaged: remove the folder to begin anew ({error.message})",
            ) from None

    def add(self, encoded: EncodedFrame, seconds: float, decided: tuple[int, ...]) -> None:
        """Add the next frame that was encoded, and what the coder of its group has decided by then."""
        if self._is_at_fault:
            return
        try:
            if self._writer is None:
                self._writer, self._decided = GroupWriter(self._keeper.header(), self._keeper.mark, self.first), decided
            self._writer.add(encoded, seconds, self._digests[self._encoded])
        except (GsvcError, UsageError):  # as will be raised when it is written to the target
            self._is_at_fault, self._writer = True, None
            return
        self._encoded += 1
        self._keep()

    def end(self, *, is_last: bool) -> None:
        """No frame follows, since another group does, or since this is the last one.

        Raises
        ------
        ChangedSourceError
            More frames were kept.
        """
        if self.kept is not None and len(self._digests) < len(self.kept.digests):
            raise self._changed(len(self._digests))
        self._is_whole = not is_last or self._keeper.is_sound()
        self._keep()

    def _keep(self) -> None:
        """Keep it if it is complete."""
        if self._is_whole and self._writer is not None and self._encoded == len(self._digests):
            self._keeper.write(self.first, self._writer.finish(self._decided))
            self._writer = None

    def _changed(self, number: int) -> ChangedSourceError:
        return ChangedSourceError(
            f"frame {self.first + number} of the source is not the one that was encoded before: give the source as it "
            f"was, or remove the folder {self._keeper.folder} to begin anew"
        )


@contextmanager
def opened_keeper(folder: str | Path | None, video: VideoFormat, settings: Settings) -> Iterator[Keeper | None]:
    """What keeps groups of pictures in a folder, if there is one, closed at the end."""
    if folder is None:
        yield None
        return
    keeper = Keeper(Path(folder), about_encode(video, settings))
    try:
        yield keeper
    finally:
        keeper.close()


def encode_kept(
    frames: Iterable[TypedFrame[Frame]], coder: GroupCoder, keeper: Keeper, progress: ProgressReporter
) -> Iterator[EncodedFrame]:
    """Encode frames as `encode_frames` does; take the groups that were kept from the keeper, and keep the others."""
    group: GroupInWork | None = None
    decided: GroupCoder | None = None
    for frame in frames:
        if frame.type == "I" or group is None:
            if group is not None:
                group.end(is_last=False)
            group = keeper.group(frame.number)
            if decided is None:
                group.decide(coder)
            else:
                coder = decided.for_group()
        if (kept := group.take(frame.frame)) is not None:
            progress.kept += 1
            progress.show("encode", frame.number)
            encoded, seconds = kept
            yield described(encoded, frame, coder, seconds)
        else:
            encoded = encode_frame(frame, coder, progress.watch)
            yield encoded
            group.add(encoded, encoded.elapsed_s, coder.decided())
        decided = decided or coder.for_group()
    if group is not None:
        group.end(is_last=True)


def digest_of(frame: Frame) -> str:
    """SHA-256 of the shape, the type and the samples of a frame."""
    array = np.ascontiguousarray(frame)
    digest = sha256(f"{array.shape} {array.dtype.str} ".encode())
    digest.update(array.data)
    return digest.hexdigest()


def _changes(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """What two encodes differ in, in words."""
    if before["code"] != now["code"]:
        return [f"made by gsvc_ref {before['code']}, this is {now['code']}"]
    found = []
    for part in ("source", "settings"):
        for name in sorted(before[part].keys() | now[part].keys()):
            old, new = before[part].get(name), now[part].get(name)
            if old != new:
                values = f"was {old}, is {new}"
                found.append(f"{part.removesuffix('s')} {name} {values if len(values) <= SHORT else 'is another'}")
    return found
