"""Reading ahead: a thread makes the next item of an iterator while the caller works on the one before."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import TypeVar

T = TypeVar("T")


def read_ahead(items: Iterator[T], worth_it: Callable[[T], bool]) -> Iterator[T]:
    """The items of an iterator; after an item that is worth it, a thread makes the next one before it is asked for.

    What the iterator raises is raised in the place of its item, after all items before. When this iterator ends or
    is closed, the thread has ended, too. Where none can be started, as at the end of a process, the caller makes all.
    """
    with ThreadPoolExecutor(1, thread_name_prefix="gsvc_ref ahead") as maker:
        item = next(items, None)
        while item is not None:
            coming: Future[T | None] | None = None
            if worth_it(item):
                with suppress(RuntimeError):  # no thread can be started
                    coming = maker.submit(next, items, None)
            yield item
            item = next(items, None) if coming is None else coming.result()
