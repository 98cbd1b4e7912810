"""The conformance kit of GSVC: golden vectors, and what judges an implementation by them.

    gsvc-conformance run --impl "my-decoder --conformance"      # any language: see protocol.md
    gsvc-conformance run --module mypackage.gsvc                # Python
    gsvc-conformance --help

Whatever an implementation can be asked is an *operation* (`operation`, `operations/`): a function of named inputs. A
*case* (`case`, `cases/`) gives inputs and asserts what must hold of the outputs; written to `vectors/` it is a *vector*
(`vectors`). What an output must be is an *expectation* (`expectations`), derived from an oracle and not from
gsvc_ref's output where rounding is left free. `runner` and `report` judge, `mutants` judges the judge. What
judges needs NumPy alone; `cases` and `streams`, which make vectors and streams, need gsvc_ref.
"""

__version__ = "0.1.0"
