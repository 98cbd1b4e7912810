"""Who and what may stand in the way in a folder that a command adopts."""

import os
import traceback
import warnings

import pytest

posix = pytest.mark.skipif(os.name != "posix", reason="links, FIFOs and owners of POSIX")
only_root = pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only root can be another user")
NOBODY = 65534


def in_the_way(kind, path, victim):
    """Put something that is not a regular file under a name."""
    path.unlink(missing_ok=True)
    if kind == "link":
        path.symlink_to(victim)
    elif kind == "dangling link":
        path.symlink_to(victim.with_name("nowhere"))
    elif kind == "FIFO":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()


KINDS = ("link", "dangling link", "FIFO", "device", "folder")


def as_nobody(work) -> None:
    """Run something in a forked child as another user, who must not succeed in what raises here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a fork while there are threads
        child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            work()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
    assert os.waitpid(child, 0)[1] == 0
