"""Fuzzing of everything that reads bytes: `python -m tests.hostile.fuzz --help`.

`targets` says what must hold for any bytes, `stream_mutations` and `other_mutations` make bytes that get far,
`seeded` runs them by a seed, `guided` by coverage, and `corpus` keeps the inputs that are worth keeping.
"""
