import errno

import pytest

from gsvc_base.cli.errors import guarded
from gsvc_base.errors import GsvcError, UsageError


def raising(error):
    def action():
        raise error

    return action


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (
            GsvcError("malformed", "it was cut", rule="R-6.2-4", bit=12),
            1,
            "malformed: it was cut [R-6.2-4, byte 1 bit 4]",
        ),
        (UsageError("splats is 0"), 2, "splats is 0"),
        (FileNotFoundError("the folder x does not exist"), 2, "the folder x does not exist"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "a.y4m"), 2, "a.y4m: No such file or directory"),
        (PermissionError(errno.EACCES, "Permission denied", b"a"), 2, "a: Permission denied; check the permissions"),
        (OSError(errno.ENOSPC, "No space left on device"), 1, "No space left on device; free some space"),
        (OSError(errno.EIO, "Input/output error", "a"), 1, "a: Input/output error"),
        (MemoryError(), 1, "not enough memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (ModuleNotFoundError("No module named 'numba'", name="numba.core"), 2, "numba is not installed: pip install ."),
        (ModuleNotFoundError("No module named 'lzma'", name="lzma"), 70, "a fault of gsvc_ref (ModuleNotFoundError"),
        (ModuleNotFoundError("No module", name="gsvc_ref.x"), 70, "a fault of gsvc_ref (ModuleNotFoundError"),
        (ZeroDivisionError("division\nby zero"), 70, "(ZeroDivisionError: division by zero)"),
    ],
)
def test_each_error_is_one_line_and_a_code(capsys, monkeypatch, error, status, words):
    monkeypatch.delenv("GSVC_DEBUG", raising=False)
    assert guarded("gsvc encode", raising(error)) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("gsvc encode: ")
    assert words in err
    assert err.count("\n") == 1


def test_a_fault_of_ours_asks_to_be_reported(capsys):
    guarded("gsvc info", raising(IndexError("7")))
    assert "Please report" in capsys.readouterr().err


def test_debug_shows_where_it_happened(capsys, monkeypatch):
    monkeypatch.setenv("GSVC_DEBUG", "1")
    assert guarded("gsvc info", raising(IndexError("7"))) == 70
    assert "Traceback" in capsys.readouterr().err


def test_a_closed_pipe_ends_silently(capsys):
    assert guarded("gsvc decode", raising(BrokenPipeError())) == 141
    assert capsys.readouterr() == ("", "")


def test_a_good_end_keeps_its_code():
    assert guarded("gsvc", lambda: 0) == 0
    assert guarded("gsvc", lambda: 1) == 1
