"""The decoder in C: all vectors of profile `main` with every optimisation allowed, and sanitizers over hostile bytes.

Compiled with FAST, the compiler may fuse, reorder, flush and vectorise as it likes: that the parameters are right to
the bit all the same shows that no operation that makes one is rounded (R-15.4-2).
"""

import re
import shutil
import subprocess
from collections import Counter

import pytest
from c_differential import compare, streams

from gsvc_conformance.adapters import c
from gsvc_conformance.pairs import sections
from gsvc_conformance.profiles import SECTION_OF_MAIN
from gsvc_conformance.results import FAULTS
from gsvc_conformance.runner import run_suite
from gsvc_conformance.server import ServerImplementation

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")

OPERATIONS = sorted(set(re.findall(r'\{"(\w+)", \w+\}', (c.FOLDER / "serve.c").read_text(encoding="utf-8"))))
SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
DAMAGED = 400


@pytest.fixture(scope="module")
def fast():
    with ServerImplementation(f"{c.program(c.FAST)} --serve", 60) as implementation:
        yield implementation


@pytest.fixture(scope="module")
def watched():
    try:
        program = c.program(SANITIZERS)
    except RuntimeError as error:
        pytest.skip(f"the compiler has no sanitizers: {error}")
    with ServerImplementation(f"{program} --serve", 60) as implementation:
        yield implementation


@pytest.fixture(scope="module")
def results(fast, vector_folder):
    names = [name for name in vector_folder.names if name.split("/")[1] in OPERATIONS]
    return run_suite(fast, vector_folder.read(names))


@pytest.mark.parametrize("operation", OPERATIONS)
def test_vectors_with_every_optimisation(results, operation):
    found = [result for result in results if result.operation == operation]
    assert any(result.outcome == "pass" for result in found)
    wrong = [f"{result.id}: {result.message}" for result in found if result.outcome in FAULTS]
    assert not wrong, "\n".join(wrong)
    assert all(result.outcome == "pass" or result.profile == "paper" for result in found)


def test_rules_and_offsets_are_right(results):
    own = [result for result in results if result.profile != "paper"]
    refused = Counter(output.refused for result in own for output in result.outputs if output.refused)
    assert set(refused) == {"rule and bit"}


def test_it_has_all_operations_of_profile_main_that_draw_nothing():
    own = {name for name, section in sections().items() if section.startswith(SECTION_OF_MAIN)}
    assert own - set(OPERATIONS) == {"decode_layers"}
    assert all(f"`{name}`" in c.__doc__ for name in set(OPERATIONS) - own)


def test_mutated_streams_are_those_of_gsvc_ref(fast):
    rules = Counter(compare(fast, data, layer) for data, layer in streams(DAMAGED, 0))
    assert rules["legal"] > DAMAGED // 40
    assert len(rules) > 12


def test_hostile_streams_under_sanitizers(watched):
    rules = Counter(compare(watched, data, layer) for data, layer in streams(DAMAGED, 1))
    assert rules["R-7-1"] > 0


def test_without_a_compiler_it_says_what_to_install(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(NotImplementedError, match="no C compiler no-such-compiler: install one, or name one in CC"):
        c.program()


def test_what_a_compiler_says_is_told(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(RuntimeError, match=r"cc, -fno-such-option does not compile the decoder: .*no-such-option"):
        c.program(["-fno-such-option"])
    assert list((tmp_path / "gsvc-c").iterdir()) == []


def test_a_program_is_compiled_once(monkeypatch):
    made = c.program(c.FAST)
    monkeypatch.setattr(c.tempfile, "TemporaryDirectory", None)
    assert c.program(c.FAST) == made


def test_an_unknown_operation_is_unsupported(tmp_path):
    assert subprocess.run([c.program(c.FAST), "render_sum", tmp_path, tmp_path], check=False).returncode == 77
