"""`python -m gsvc_conformance.adapters.c [--serve | OPERATION IN OUT]`: compile the decoder, and become it."""

import os
import sys

from gsvc_conformance.adapters.c import program

if __name__ == "__main__":
    path = str(program())
    os.execv(path, [path, *sys.argv[1:]])
