"""Seconds by stage of the work."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TypeVar

ItemT = TypeVar("ItemT")


class StageSeconds(dict[str, float]):
    """Seconds by the name of each stage, in the order of their beginnings."""

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time that the block takes to a stage."""
        begin = time.perf_counter()
        yield
        self.add({stage: time.perf_counter() - begin})

    def add(self, others: Mapping[str, float]) -> None:
        """Add the seconds of other work, stage by stage."""
        for stage, seconds in others.items():
            self[stage] = self.get(stage, 0.0) + seconds

    def timed_items(self, stage: str, items: Iterator[ItemT]) -> Iterator[ItemT]:
        """The items of an iterator; the time that each takes to come is added to a stage."""
        while True:
            with self.timed(stage):
                try:
                    item = next(items)
                except StopIteration:
                    return
            yield item
