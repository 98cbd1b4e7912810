"""Profile `main` in the kit: operations and claims of its own, and wrong decoders that are named."""

from collections import Counter
from collections.abc import Mapping
from functools import cache
from typing import Final

import pytest

from gsvc_conformance import diagnose
from gsvc_conformance.case import TIERS, cases
from gsvc_conformance.claim import Claim, read_claim
from gsvc_conformance.coverage import manifests
from gsvc_conformance.features import features_of
from gsvc_conformance.level import LEVELS
from gsvc_conformance.mutants import Mutant, answer, main_profile
from gsvc_conformance.operation import operations
from gsvc_conformance.pairs import sections
from gsvc_conformance.profiles import ANY, OF_PAPER, PROFILES, profile_of, stated_profile
from gsvc_conformance.profiles import of_main as is_of_main
from gsvc_conformance.results import Result
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_conformance.verdicts import Report

OF_MAIN: Final = [
    name for name in sections() if is_of_main(name) and all(port.type != "stream" for port in operations()[name].inputs)
]
ELEMENTARY: Final = [case for case in cases().values() if case.operation.name in OF_MAIN and case.tier in TIERS]


@cache
def vector(name: str) -> Vector:
    """A golden vector."""
    (found,) = VectorFolder(VECTORS).read([name])
    return found


def test_every_elementary_operation_has_cases_of_three_tiers() -> None:
    for name in OF_MAIN:
        tiers = {case.tier for case in ELEMENTARY if case.operation.name == name}
        assert {"core", "stress"} <= tiers, name


def test_profiles_name_operations() -> None:
    assert set(OF_PAPER) <= operations().keys()
    assert len(OF_MAIN) > 10
    assert profile_of(operations()["render_sum"], {"width": 3}) == ANY
    assert profile_of(operations()["reconstruct_stream"], {"stream": b"no stream"}) == ANY


@pytest.mark.parametrize("profile", PROFILES)
def test_a_decoder_of_one_profile_can_claim_every_class_of_it(profile: str) -> None:
    """By R-13-1: it refuses streams that state the other profile, and is asked none."""
    folder, answers = VectorFolder(VECTORS), dict[str, list[Result]]()
    for name in folder.select(Selection(profile=profile)):
        about, streams = folder.manifest(name), (VECTORS / name).glob("*.gsvc")
        stated = {stated_profile(stream.read_bytes()) for stream in streams}
        outcome = "pass" if stated <= {profile, ANY} else "unsupported"
        found = Result(name, about["title"], about["class"], outcome, level=about["level"], profile=about["profile"])
        answers.setdefault(found.group, []).append(found)
    assert answers.keys() >= {"bitstream", "reconstruction", "rendering", "deterministic", "seeking", "sizes"}
    for group, results in answers.items():
        report = Report({}, "", "", (), results, claim=Claim((group,), profile, max(LEVELS)))
        assert [one.verdict for one in report.groups()] == ["passed"], group


def test_claims_and_features_name_the_profile() -> None:
    assert read_claim("bitstream+reconstruction,main,2,layers").profile == "main"
    of_main, of_paper = (features_of({"profiles": [name]}, "here") for name in ("main", "paper"))
    one = vector("core/main_intra/one_splat")
    assert (of_main.outside(one), of_paper.outside(one)) == ("", "profile main")


PLANTED: Final = (
    "exp2-one-number", "vector-contexts-of-magnitudes", "past-not-compacted", "past-forgotten-where-repeated",
    "position-shear-without-maximum", "window-below-512", "counts-divided-by-their-shifted-sum", "halves-low-bits-late",
    "densities-kept-over-i-frames", "layer-splats-alone-counted", "place-of-a-bit-at-least", "halves-first-below",
)  # fmt: skip
"""Faults that somebody planted in a decoder of their own, of which some hung on one vector or on none."""


def test_planted_faults_hang_on_three_vectors_at_least() -> None:
    killers = Counter(name for manifest in manifests() for name in manifest["kills"])
    assert {name: killers[name] for name in PLANTED if killers[name] < 3} == {}


def test_streams_find_what_components_find_too() -> None:
    of_streams = ("read_main_stream", "reconstruct_stream", "reconstruct_layers")
    killed = {name for manifest in manifests() if manifest["operation"] in of_streams for name in manifest["kills"]}
    assert killed >= set(PLANTED)


DECODERS: Final[Mapping[str, str]] = {
    "exp2-rounded": "core/main_inter/fractions_of_octaves",
    "exp2-of-magnitude": "core/main_inter/fractions_of_octaves",
    "class-threshold": "core/splat_classes/classes_at_their_thresholds",
    "class-threshold-not-reached": "core/splat_classes/classes_at_their_thresholds",
    "class-not-rounded": "core/splat_classes/classes_round_their_colors_even",
    "n-multiplied-before-it-is-clipped": "uncommon/main_intra/colors_are_clipped_before_they_are_multiplied",
    "aspect-negated": "core/main_intra/size_and_aspect",
    "place-octave-to-zero": "core/main_intra/places_of_negative_sizes",
    "position-step-without-maximum": "core/main_inter/least_and_largest_position_steps",
    "position-shear-negated": "core/main_inter/position_in_its_own_axes",
    "position-shear-floored": "core/main_inter/shear_of_position_is_rounded_to_zero",
    "sheared-the-other-way": "core/main_inter/aspect_keeps_l21_over_l11",
    "sheared-floored": "core/main_inter/sheared_towards_zero",
    "class-behind-the-change": "core/main_inter/class_of_the_reference",
    "area-to-zero": "core/state_parameters/odd_sums_of_sizes",
    "area-negated-late": "core/state_parameters/odd_sums_of_sizes",
    "parameters-cut-off": "core/state_parameters/ties_of_parameters",
    "parameters-ties-up": "core/state_parameters/ties_of_parameters",
    "color-shift-of-luma": "core/state_parameters/colors_of_all_magnitudes",
    "work-of-main-inward": "core/main_work/sides_at_a_pixel_edge",
    "work-of-main-halved-down": "core/main_work/halved_3",
    "motion-not-rounded": "core/motion_of_splats/motion_rounds_up_at_halves",
    "motion-rounded-from-zero": "core/motion_of_splats/motion_rounds_up_at_halves",
    "unrest-of-corners": "core/mode_contexts/four_neighbours",
    "unrest-summed": "core/mode_contexts/greatest_of_the_neighbours",
    "unrest-where-it-moves-to": "core/mode_contexts/cell_before_it_moves",
    "adapted-by-5-8": "core/adapt_model/contexts_that_were_used",
    "unused-contexts-adapted": "core/adapt_model/contexts_that_were_used",
    "rest-to-the-last": "core/model_frequencies/rest_of_the_first_largest",
    "rest-to-the-largest-count": "core/model_frequencies/rest_of_the_first_of_equal_frequencies",
    "counts-not-shifted": "core/model_frequencies/models_of_a_stream",
    "density-to-zero": "core/density_frequencies/negative_centres_logistic",
    "density-shift-rounded-down": "core/density_frequencies/scales_1",
    "halves-up-to-16": "core/half_frequencies/equal_halves_16",
    "halves-up-to-14": "core/half_frequencies/equal_halves_15",
    "halves-of-any-size": "core/half_frequencies/unequal_halves_9_of_16",
}
"""Wrong decoders of the catalogue, and a vector whose answer names each."""


def mutant(name: str) -> Mutant:
    """A mutant of the catalogue."""
    return next(one for one in main_profile.MUTANTS if one.name == name)


@pytest.mark.parametrize("name", DECODERS)
def test_the_diagnosis_names_it(name: str) -> None:
    about = vector(DECODERS[name])
    group = [case.id for case in ELEMENTARY if case.operation is about.operation and case.tier == "core"]
    vectors = [vector(one) for one in dict.fromkeys([DECODERS[name], *group[:4]])]
    answers = [(one, answer(mutant(name), one.operation, one.inputs)) for one in vectors]
    said = " ".join(diagnose((one, outputs) for one, outputs in answers if outputs is not None))
    assert mutant(name).sentence in said
