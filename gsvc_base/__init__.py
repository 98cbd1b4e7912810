"""gsvc_base: what gsvc_ref, gsvc_lab and the conformance kit share; it needs NumPy alone.

`spec` is the code of spec.md, `document` its text, `syntax` its tables. `splats`, `arrays`, `constants`, `checks` and
`errors` are the data that everybody passes on. `draws` and `portable` compute the same bits on every machine.
`rendering` says in binary64 what a picture is and how far binary32 may be from it; `exact` has the sums of exact
numbers and the running errors that bounds come from. `files`, `interrupts`, `cli` and `pages` write what people read.
"""
