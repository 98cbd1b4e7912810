"""Splats in NPZ files, as `numpy.savez` writes them.

| name | shape and type | |
|---|---|---|
| ``parameters`` | (S, 8) float16, float32, float64 or integers, S the sum of the counts; or without ``counts`` (N, 8) for one frame, (T, N, 8) for T | x, y, l11, l21, l22, R, G, B of the splats of frame 0, then of frame 1 … |
| ``counts`` | (T,) integers | the number of splats of each frame |
| ``ids`` | (S,) integers; may be missing | equal numbers in successive frames are the same splat |
| ``width``, ``height`` | integers; may be missing | size of the frames in pixels |
| ``frame_rate`` | a number, or two integers (numerator, denominator); may be missing | frames per second |

Other names are left alone. Frames are read one by one, however large the file.
"""  # noqa: E501  (a table)

import errno
import io
import math
import sys
import warnings
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryFile
from types import TracebackType
from typing import IO, Any, BinaryIO, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, I8
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import complete_file
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref.bitstream import level_for
from gsvc_ref.video.format import array_format

MAX_NPZ_FRAMES: Final = 1 << 20
"""Maximum number of frames of a file: their counts are held in memory."""

MAX_NPZ_SPLATS: Final = 1 << 22
"""Maximum number of splats of a frame, that of the highest level (R-5-2)."""

MAX_DIRECTORY: Final = 1 << 20
"""Maximum number of bytes of the list of arrays in a file, which zipfile reads at once."""


class _Header(NamedTuple):
    """What an array in the file says of itself."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    bytes_after: int
    """What the archive says is there of its elements."""


class _File(io.FileIO):
    """A file that refuses a read of more than `most` bytes."""

    most = MAX_DIRECTORY

    def read(self, size: int | None = -1, /) -> bytes:
        """Read, perhaps less."""
        if size is not None and size > self.most:
            raise zipfile.BadZipFile(f"the list of its arrays takes {size} bytes; at most {self.most} are read")
        return super().read(size)


class NpzSplats:
    """The splats of an NPZ file: iterate once over frames (N, 8) f4, or pairs of these and their ids (N,) i8.

    `width`, `height` (pixels) and `frame_rate` are None where the file does not say them. A file that is no such NPZ
    is refused with a GsvcError, kind ``limit`` for more than 2^20 frames or 2^22 splats in one.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._file = _File(self.path)
        try:
            with self._reading():
                self._zip = zipfile.ZipFile(self._file)
            self._file.most = sys.maxsize
            self._open()
        except BaseException:
            self.close()
            raise

    def _open(self) -> None:
        parameters = self._header_of("parameters")
        shape = parameters.shape
        if not (len(shape) in (2, 3) and shape[-1] == PARAMETERS_PER_SPLAT):
            self._refuse(f"parameters have the shape {shape}; it must be (splats, {PARAMETERS_PER_SPLAT})")
        counts = self._small("counts", MAX_NPZ_FRAMES)
        if counts is None:
            frames, count = (1, shape[0]) if len(shape) == 2 else shape[:2]
            self._check_limit(frames, MAX_NPZ_FRAMES, "frames")
            self.counts: I8 = np.full(frames, min(count, MAX_NPZ_SPLATS + 1), np.int64)
        else:
            if counts.ndim != 1 or counts.dtype.kind not in "iu" or len(shape) != 2:
                self._refuse("counts must be integers, one for each frame, and parameters (splats, 8)")
            wide = counts.astype(f"{counts.dtype.kind}8")  # a type of 8 bits has no room for the limit
            self.counts = np.minimum(wide, MAX_NPZ_SPLATS + 1).astype(np.int64)
        self._check_limit(int(self.counts.max(initial=0)), MAX_NPZ_SPLATS, "splats in a frame")
        if (self.counts < 0).any():
            frame = int(np.flatnonzero(self.counts < 0)[0])
            self._refuse(f"counts[{frame}] is {self.counts[frame]}; it must be the number of splats of frame {frame}")
        total = int(self.counts.sum())
        if total != math.prod(shape[:-1]):
            self._refuse(f"counts add up to {total} splats; parameters has {math.prod(shape[:-1])}")
        self._check_size("parameters", parameters)
        self._ids = "ids.npy" in self._zip.namelist()
        if self._ids:
            ids = self._header_of("ids")
            if ids.dtype.kind not in "iu" or ids.shape != (total,):
                self._refuse(f"ids are {ids.dtype} of shape {ids.shape}; they must be integers, ({total},)")
            self._check_size("ids", ids)
        self.width, self.height = self._whole("width"), self._whole("height")
        self.frame_rate = self._frame_rate()
        try:
            width, height = (1 if side is None else side for side in (self.width, self.height))
            video = array_format(width, height, self.frame_rate or 1, bit_depth=8)
            level_for(video.width, video.height)
        except UsageError as error:
            self._refuse(str(error))

    def __len__(self) -> int:
        return len(self.counts)

    def __iter__(self) -> Iterator[F4 | tuple[F4, I8]]:
        with self._reading(), self._member("parameters") as parameters, ExitStack() as stack:
            numbers = self._header(parameters, "parameters")
            ids, integers = None, numbers
            if self._ids:
                ids = stack.enter_context(self._member("ids"))
                integers = self._header(ids, "ids")
            for frame, count in enumerate(self.counts.tolist()):
                values = self._rows(parameters, numbers, (count, PARAMETERS_PER_SPLAT), frame)
                with np.errstate(over="ignore"):
                    splats = values.astype(np.float32)
                if ids is None:
                    yield splats
                else:
                    yield splats, self._rows(ids, integers, (count,), frame).astype(np.int64)

    def close(self) -> None:
        """Close the file, also where an iteration has not come to its end."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _refuse(self, message: str) -> None:
        raise GsvcError("malformed", f"{self.path}: {message}")

    def _check_limit(self, count: int, most: int, what: str) -> None:
        if count > most:
            raise GsvcError("limit", f"{self.path} has more than {most} {what}, which are the most that are read")

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Report faults of the bytes as a GsvcError: zipfile and NumPy raise anything where they make no sense."""
        try:
            yield
        except GsvcError:
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno != errno.EINVAL:  # which a place before the file's start is
                raise
            why = " ".join(str(error).split()) or type(error).__name__
            raise GsvcError("malformed", f"{self.path} is not a sound NPZ file: {why}") from None

    def _member(self, name: str) -> IO[bytes]:
        if f"{name}.npy" not in self._zip.namelist():
            held = ", ".join(self._zip.namelist()[:8]) or "nothing"
            self._refuse(f"there is no array {name!r} in it (it has {held}); see docs/splats-in-and-out.md")
        member = self._zip.getinfo(f"{name}.npy")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # others inflate without a limit
            self._refuse(f"{name} is compressed in another way than numpy.savez and savez_compressed have; use these")
        return self._zip.open(member)

    def _header(self, file: IO[bytes], name: str) -> _Header:
        """Read the header of an array, of version 1.0 alone: that of later ones may take gigabytes."""
        version = np.lib.format.read_magic(file)
        if version != (1, 0):
            self._refuse(f"{name} is in version {version} of NumPy's format; save it again with numpy.savez")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # headers of Python 2
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        if dtype.kind not in "fiu" or dtype.itemsize > 8:
            self._refuse(f"{name} is {dtype}; it must be float16, float32, float64, or integers of up to 64 bits")
        if any(side < 0 for side in shape) or (fortran and len(shape) > 1):
            self._refuse(f"{name} must be in C order; save numpy.ascontiguousarray(...)")
        return _Header(shape, dtype, self._zip.getinfo(f"{name}.npy").file_size - file.tell())

    def _check_size(self, name: str, header: _Header) -> None:
        """Refuse an array that claims more elements than there are, or fewer, before anything is read of them."""
        size = math.prod(header.shape) * header.dtype.itemsize
        if size != header.bytes_after:
            self._refuse(
                f"{name} takes {size} bytes by its header, and has {header.bytes_after}; fetch or write it again"
            )

    def _header_of(self, name: str) -> _Header:
        with self._reading(), self._member(name) as file:
            return self._header(file, name)

    def _rows(self, file: IO[bytes], header: _Header, shape: tuple[int, ...], frame: int) -> NDArray[Any]:
        size = math.prod(shape) * header.dtype.itemsize
        data = file.read(size)
        if len(data) != size:
            self._refuse(f"it ends inside frame {frame}; fetch or write it again")
        return np.frombuffer(data, header.dtype).reshape(shape)

    def _small(self, name: str, most: int) -> NDArray[Any] | None:
        """An array of at most `most` numbers, or None if there is none."""
        if f"{name}.npy" not in self._zip.namelist():
            return None
        with self._reading(), self._member(name) as file:
            header = self._header(file, name)
            self._check_limit(math.prod(header.shape), most, f"numbers in {name!r}")
            self._check_size(name, header)
            return self._rows(file, header, header.shape, 0)

    def _whole(self, name: str) -> int | None:
        value = self._small(name, 1)
        if value is not None and (value.size != 1 or value.dtype.kind not in "iu"):
            self._refuse(f"{name} must be one integer, in pixels")
        return None if value is None else int(value.ravel()[0])

    def _frame_rate(self) -> Fraction | None:
        value = self._small("frame_rate", 2)
        if value is None:
            return None
        numbers = value.ravel().tolist()
        if len(numbers) == 2 and value.dtype.kind in "iu" and min(numbers) > 0:
            return Fraction(*numbers)
        if len(numbers) != 1 or not 0 < numbers[0] < math.inf:
            self._refuse("frame_rate must be a number above 0, or two integers (numerator, denominator)")
        return Fraction(str(numbers[0]))


def write_npz(
    path: str | Path, frames: Iterable[tuple[F4, I8]], width: int, height: int, frame_rate: Fraction
) -> list[int]:
    """Write the parameters (N, 8) and ids (N,) of frames, taken one by one, as an NPZ file that `NpzSplats` reads.

    The size is in pixels, the frame rate in frames per second; returns the number of splats of each frame.
    """
    with TemporaryFile() as parameters, TemporaryFile() as ids:
        counts = []
        for splats, numbers in frames:
            parameters.write(np.ascontiguousarray(splats, "<f4").tobytes())
            ids.write(np.ascontiguousarray(numbers, "<i8").tobytes())
            counts.append(len(splats))
        rate = np.array([frame_rate.numerator, frame_rate.denominator], "<i8")
        with complete_file(Path(path)) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            _add(archive, "parameters", (sum(counts), PARAMETERS_PER_SPLAT), "<f4", parameters)
            _add(archive, "ids", (sum(counts),), "<i8", ids)
            for name, value in {"counts": counts, "width": width, "height": height, "frame_rate": rate}.items():
                with archive.open(f"{name}.npy", "w") as member:
                    np.lib.format.write_array(member, np.asarray(value, "<i8"))
    return counts


def _add(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], dtype: str, data: IO[bytes] | BinaryIO) -> None:
    """Add an array whose elements are in a file."""
    data.seek(0)
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        header = {"descr": dtype, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(member, header)
        copyfileobj(data, member)
