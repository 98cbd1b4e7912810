"""Numba; variables of the environment that it cannot use are wrong use of gsvc_ref, as it reads them on import."""

import os

from gsvc_ref.errors import UsageError

try:
    import numba
except ValueError as error:
    VARIABLES = ", ".join(name for name in os.environ if name.startswith("NUMBA_"))
    raise UsageError(f"Numba does not start ({str(error).rstrip('.')}): correct or unset {VARIABLES}") from None

__all__ = ["numba"]
