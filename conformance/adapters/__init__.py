"""Implementations that are not gsvc_ref, in languages of GPUs, judged by the kit: start from the one nearest to yours.

None of them imports gsvc_ref: they are written from spec.md.
"""
