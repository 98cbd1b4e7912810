"""The targets by name: what they run, what they begin with, and how their inputs are mutated."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

from gsvc_base.draws import Draws
from gsvc_conformance.cases.faulty_main import MANY, streams
from gsvc_conformance.cases.main_layers import BASE, LAYERS, with_layers
from gsvc_conformance.cases.main_streams import Plan
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    overview_frames,
    random_main_stream,
    random_stream,
    rich_frames,
    write_stream,
)

from . import (
    command_mutations,
    command_targets,
    kit_mutations,
    kit_targets,
    other_mutations,
    other_targets,
    targets,
)
from .recoding import plane_recoded
from .stream_mutations import mutate_stream

CORPUS: Final = Path(__file__).parents[1] / "corpus"

RANDOM_STREAMS: Final = 240
MAIN_STREAMS: Final = 80
LAYERED_STREAMS: Final = 8
LONGEST_SEED: Final = 700
"""How many random streams of at most so many bytes fuzzing begins with, beside the corpus: of profile `paper`, of
profile `main`, and of that with layers."""


def some_streams() -> list[bytes]:
    """The two example streams and small random ones, many with coded planes; together they use all of the syntax."""
    made = [write_stream(OVERVIEW_HEADER, overview_frames()), write_stream(RICH_HEADER, rich_frames(12))]
    seed = 0
    while len(made) < RANDOM_STREAMS:
        most = (1, 2, 3, 4, 24, 60)[seed % 6]
        data = random_stream(seed, max_frames=3, max_count=most, max_pixels=(64, 1024, 4096)[seed % 7 % 3]).data
        for _ in range(seed % 4):
            data = plane_recoded(data, Random(seed), made)
        if len(data) <= LONGEST_SEED:
            made.append(data)
        seed += 1
    return made + some_main_streams()


def some_main_streams() -> list[bytes]:
    """Small random streams of profile `main`, of one layer and of four, and some with what is rare in them."""
    made: list[bytes] = []
    seed = 0
    while len(made) < MAIN_STREAMS:
        sizes = {"max_count": (1, 2, 4, 24)[seed % 4], "max_pixels": (64, 1024, 4096)[seed % 3]}
        data = random_main_stream(seed, max_frames=4, **sizes).data
        if len(data) <= LONGEST_SEED:
            made.append(data)
        seed += 1
    checked = {"parameter_checksum_flag": True}
    layered = (
        with_layers(Draws(seed), BASE, LAYERS, **(checked if seed % 2 else {})) for seed in range(LAYERED_STREAMS)
    )
    empty = (streams((Plan("I"), Plan("P", count))) for count in range(1, 5))  # a P-frame that needs densities
    return [*made, *layered, *empty, streams(MANY, max_lane_exponent=6)]


@dataclass(frozen=True)
class Target:
    """Something that is fuzzed.

    Attributes
    ----------
    run
        Takes an input; returns a word for what came of it, and raises only for a defect.
    folder
        Of the corpus.
    seeds
        Inputs to begin with, beside the corpus.
    mutate
        Another input from one, a generator, and others to take parts from.
    """

    run: Callable[[bytes], str]
    folder: str
    seeds: Callable[[], list[bytes]]
    mutate: Callable[[bytes, Random, Sequence[bytes]], bytes]

    def corpus(self) -> list[Path]:
        """The files of the corpus that are inputs of this target."""
        return sorted((CORPUS / self.folder).glob("*.bin"))


def _of_streams(run: Callable[[bytes], str]) -> Target:
    return Target(run, "streams", some_streams, mutate_stream)


TARGETS: Final[dict[str, Target]] = {
    "parser": _of_streams(targets.parser),
    "reencode": _of_streams(targets.reencode),
    "pictures": _of_streams(targets.pictures),
    "differential": _of_streams(targets.differential),
    "planes": Target(other_targets.planes, "planes", other_mutations.some_planes, other_mutations.mutate_plane),
    "videos": Target(other_targets.videos, "videos", other_mutations.some_videos, other_mutations.mutate_video),
    "settings": Target(
        other_targets.settings, "settings", other_mutations.some_settings, other_mutations.mutate_settings
    ),
    **{command: _of_streams(command_targets.of_stream(command)) for command in command_targets.STREAMS},
    "listing": _of_streams(command_targets.listing),
    "import": Target(
        command_targets.splat_files, "splats", command_mutations.some_splat_files, command_mutations.mutate_splat_file
    ),
    "scene": Target(command_targets.scenes, "scenes", command_mutations.some_scenes, command_mutations.mutate_scene),
    "log": Target(command_targets.logs, "logs", command_mutations.some_logs, command_mutations.mutate_log),
    "kit_reports": Target(kit_targets.reports, "kit_reports", kit_mutations.some_reports, kit_mutations.mutate_report),
    "kit_speeds": Target(kit_targets.speeds, "kit_speeds", kit_mutations.some_speeds, kit_mutations.mutate_report),
    "kit_tables": Target(kit_targets.tables, "kit_tables", kit_mutations.some_tables, kit_mutations.mutate_table),
    "kit_vectors": Target(
        kit_targets.archives, "kit_vectors", kit_mutations.some_vectors, kit_mutations.mutate_vectors
    ),
    "kit_answers": Target(
        kit_targets.written_answers, "kit_answers", kit_mutations.some_answers, kit_mutations.mutate_answer
    ),
    "kit_servers": Target(
        kit_targets.dialogues, "kit_servers", kit_mutations.some_dialogues, kit_mutations.mutate_dialogue
    ),
}


def name_of(origin: str, data: bytes) -> str:
    """The name of a file of the corpus: where it comes from, and its hash."""
    return f"{origin}-{hashlib.sha256(data).hexdigest()[:12]}.bin"
