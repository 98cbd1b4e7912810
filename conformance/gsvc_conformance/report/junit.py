"""A run of the suite as JUnit XML, which continuous integration shows as tests."""

import re
from xml.etree import ElementTree as ET

from gsvc_conformance.causes import looks_like
from gsvc_conformance.results import FAULTS, Result
from gsvc_conformance.verdicts import Report

NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold, not even escaped."""


def junit_xml(report: Report) -> str:
    """The report: a suite for each operation, a test for each vector; what is unsupported is skipped.

    Each stale waiver that a run must not have is a test that fails.
    """
    root = ET.Element("testsuites", name="GSVC conformance")
    for operation in report.operations():
        suite = ET.SubElement(root, "testsuite", name=operation.name, tests=str(operation.total))
        properties = ET.SubElement(suite, "properties")  # of a suite: the format knows none of the whole
        for name, value in _properties(report).items():
            ET.SubElement(properties, "property", name=_clean(name), value=_clean(value))
        tests = [_test(result, report) for result in report.results if result.operation == operation.name]
        suite.extend(tests)
        _count(suite, tests)
    if report.stale:
        suite = ET.SubElement(root, "testsuite", name="waivers", tests=str(len(report.stale)))
        suite.extend(tests := [_stale_test(number, said) for number, said in enumerate(report.stale, 1)])
        _count(suite, tests)
    root.set("tests", str(len(tests := list(root.iter("testcase")))))
    _count(root, tests)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _properties(report: Report) -> dict[str, str]:
    """The environment, what the implementation runs on, and the verdicts that can be quoted."""
    runs_on = {f"implementation.{name}": value for name, value in report.runs_on.items()}
    claim = {"claim": str(report.claim)} if report.claim else {}
    claim |= {"features": str(report.features)} if report.features else {}
    verdicts = {f"verdict.{number}": quote for number, quote in enumerate(report.quotes(), 1)}
    return {**report.environment, **runs_on, **claim, **verdicts}


def _count(suite: ET.Element, tests: list[ET.Element]) -> None:
    """Write beside a suite, or all of them, what became of the tests, and their seconds."""
    for kind, name in (("failure", "failures"), ("error", "errors"), ("skipped", "skipped")):
        suite.set(name, str(sum(test.find(kind) is not None for test in tests)))
    suite.set("time", f"{sum(float(test.get('time', 0)) for test in tests):.3f}")


def _stale_test(number: int, sentence: str) -> ET.Element:
    """A waiver that has to leave its file, as a test that fails."""
    test = ET.Element("testcase", classname="waivers", name=f"stale_{number}", time="0.000")
    ET.SubElement(test, "failure", message=_clean(sentence), type="stale")
    return test


def _test(result: Result, report: Report) -> ET.Element:
    tier, operation, slug = result.id.split("/")
    test = ET.Element("testcase", classname=f"{tier}.{operation}", name=slug, time=f"{result.seconds:.3f}")
    if result.outcome == "pass":
        return test
    wrong = result.outcome in FAULTS
    kind = ("failure" if result.outcome == "fail" else "error") if wrong else "skipped"
    entry = ET.SubElement(test, kind, message=_clean(f"{result.outcome}: {result.message}"))
    if wrong:
        entry.set("type", result.outcome)
        causes = list(map(looks_like, result.causes))
        entry.text = _clean("\n".join([result.title, *causes, f"again: {report.again(result.id)}"]))
    if result.log:
        ET.SubElement(test, "system-out").text = _clean(result.log)
    return test


def _clean(text: str) -> str:
    return NOT_XML.sub("\ufffd", text)
