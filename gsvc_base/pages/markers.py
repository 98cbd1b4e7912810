"""Text between two markers of a document, which a command puts there."""

from pathlib import Path

from gsvc_base.errors import UsageError
from gsvc_base.files import write_text


def replaced(document: str, begin: str, end: str, text: str, name: str = "the document") -> str:
    """The document with the text in place of all that stands between two markers, blank lines around it.

    It holds `begin` once and after it `end`, of which the first counts; else a UsageError names it.
    """
    before, found, rest = document.partition(begin)
    _, ended, after = rest.partition(end)
    if not (found and ended) or begin in rest:
        raise UsageError(f"{name} needs the line {begin!r} once, and after it the line {end!r}")
    return f"{before}{begin}\n\n{text.strip()}\n\n{end}{after}"


def check_markers(path: Path, begin: str, end: str) -> None:
    """Refuse a file that `put_between` cannot change."""
    replaced(_document(path), begin, end, "", str(path))


def put_between(path: Path, begin: str, end: str, text: str) -> None:
    """Replace what stands between two markers of a file."""
    write_text(replaced(_document(path), begin, end, text, str(path)), path)


def _document(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise UsageError(f"{path} is not text in UTF-8; give the document that has the lines") from None
