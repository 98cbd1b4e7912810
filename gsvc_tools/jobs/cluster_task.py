"""What a worker of a cluster is asked to do."""

import pickle

from gsvc_tools.jobs.code_version import code_version


class OtherCodeError(Exception):
    """A worker has another version of gsvc_ref, whose bytes may differ."""


def worker_code() -> str:
    """The version of gsvc_ref that this process has."""
    return code_version()


def call(version: str, data: bytes) -> bytes:
    """Make a call that is pickled as (function, arguments, options), if this process has the same version.

    Returns a pickled pair: the address of the worker, and what the call returned.
    """
    if version != code_version():
        raise OtherCodeError(f"a worker has gsvc_ref {code_version()}, and its caller {version}")
    function, arguments, options = pickle.loads(data)
    from distributed import get_worker

    return pickle.dumps((get_worker().address, function(*arguments, **options)))
