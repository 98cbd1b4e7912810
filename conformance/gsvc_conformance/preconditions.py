"""The preconditions of the operations (spec.md section 4.3): what no implementation is asked for.

A vector of inputs that break one would judge nothing.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_conformance.expectations import Exact
from gsvc_conformance.level import LEVELS
from gsvc_conformance.operation import Operation, Values, operations
from gsvc_conformance.profiles import stated_profile
from gsvc_conformance.spec import namespace

Rule = tuple[str, Callable[[Values], Any]]
"""A sentence that must be true of the inputs, and the function that says whether it is."""

LIMITS: Final = namespace()["LEVELS"]
MAX_SIDE: Final = 65535
MAX_ALPHABET: Final = 4096
MAX_CODEWORDS: Final = 1024
MAX_STAGES: Final = 8
LARGEST_HALF: Final = 65504.0
SMALLEST_NORMAL: Final = 2.0**-126
BELOW_ONE: Final = float(np.nextafter(1, 0))
CONVERTED: Final = (0, 1, 2, 4, 5, 6, 7, 8, 9)
"""Values of matrix_coefficients that section 11.1 converts."""

SIDES: Final = ("width", "height", "new_width", "new_height")
RANGES: Final[Mapping[str, tuple[float, float]]] = {
    **dict.fromkeys(SIDES, (1, MAX_SIDE)),
    "bit_depth": (8, 16),
    "entropy_precision": (12, 16),
    "video_full_range_flag": (0, 1),
    "chroma_sample_loc_type": (0, 5),
    "alphabet": (1, MAX_ALPHABET),
    "interval": (1, np.inf),
    "patience": (1, np.inf),
    "tolerance": (0, np.inf),
    "robust": (0, 1),
    "decay": (0, BELOW_ONE),
    "uniforms": (0, BELOW_ONE),
    "beta1": (0, BELOW_ONE),
    "beta2": (0, BELOW_ONE),
    "beta3": (0, BELOW_ONE),
    "codebook_sizes": (1, MAX_CODEWORDS),
    "level": (1, max(LEVELS)),
    "key_frame_interval": (0, np.inf),
    "frame_rate_numerator": (1, 2**31 - 1),
    "frame_rate_denominator": (1, 2**31 - 1),
    "quantizer": (0, 79),
    "density_family": (0, 1),
    "scale_code": (0, 63),
    "unit_bits": (0, 4),
    "motion_cell": (0, 3),
    "layer": (0, 3),
    "past": (0, 2),
    "vectors": (-(2**15), 2**15 - 1),
    "motion": (-(2**22) + 1, 2**22 - 1),
    "differences": (-(2**12) + 1, 2**12 - 1),
    "colors": (-(2**20) + 1, 2**20 - 1),
    "seen": (0, 2**22 - 1),
}
"""The range of inputs by name, whatever the operation; both ends are allowed."""

ANY_BITS: Final = {
    ("to_frame_deterministic", "sum"), *(("compact", name) for name in ("values", "m", "v", "n", "previous")),
}  # fmt: skip
"""Inputs, by operation and name, that may have infinities and NaN."""
INFINITIES: Final[Mapping[tuple[str, str], tuple[int, ...]]] = {
    **{(name, "parameters"): (2, 4) for name in ("render_sum", "render_frame", "render_gradients")},
    ("render_sum_deterministic", "parameters"): (0, 1, 2, 3, 4),
    ("to_frame", "sum"): (0, 1, 2),
}
"""Inputs, by operation and name, of which some columns (of the last axis) may have infinities, and no NaN."""


def broken(operation: Operation, inputs: Values) -> list[str]:
    """The preconditions of an operation that inputs of the right types and shapes break, a sentence each.

    Parameters
    ----------
    operation
        The operation.
    inputs
        Its inputs, by name.
    """
    found = [*_not_finite(operation, inputs), *_out_of_range(inputs), *_sides(operation, inputs)]
    if found:
        return found  # the rules below take such numbers for granted
    rules = [*_samples(operation), *ROWS.get(operation.name, ())]
    first = next((sentence for sentence, holds in rules if not holds(inputs)), None)  # each relies on those before it
    return [first] if first else []


def _not_finite(operation: Operation, inputs: Values) -> Iterator[str]:
    for name, value in inputs.items():
        if isinstance(value, bytes) or (operation.name, name) in ANY_BITS:
            continue
        array = np.asarray(value)
        columns = INFINITIES.get((operation.name, name), ())
        wrong = ~np.isfinite(array)
        if columns:
            wrong[..., list(columns)] = np.isnan(array[..., list(columns)])
        if wrong.any():
            place = [int(i) for i in np.argwhere(wrong)[0]]
            but = f", but for infinities in its columns {', '.join(map(str, columns))}" if columns else ""
            yield f"{name} must be finite{but}; it is {array[tuple(place)]}{f' at {place}' if place else ''}"


def _out_of_range(inputs: Values) -> Iterator[str]:
    for name, (low, high) in RANGES.items():
        if name in inputs and not np.all((inputs[name] >= low) & (inputs[name] <= high)):
            above = "at least 0 and below 1" if high == BELOW_ONE else f"{low:g} to {high:g}"
            yield f"{name} must be {f'at least {low:g}' if np.isinf(high) else above}"


def _sides(operation: Operation, inputs: Values) -> Iterator[str]:
    for port in operation.inputs:
        symbols = port.shape.strip("()").lower().split(", ")
        if {"h", "w"} <= set(symbols):
            height, width = (inputs[port.name].shape[symbols.index(symbol)] for symbol in ("h", "w"))
            if not (1 <= height <= MAX_SIDE and 1 <= width <= MAX_SIDE):
                yield f"the sides of {port.name} must be 1 to {MAX_SIDE}; it has {width}x{height} pixels"


def _samples(operation: Operation) -> Iterator[Rule]:
    """Samples are at most the peak of their bit depth."""
    for port in operation.inputs:
        if port.type == "u1|u2":
            yield f"no sample of {port.name} may be above 2^bit_depth - 1", partial(_keeps_the_peak, port.name)


def _keeps_the_peak(name: str, inputs: Values) -> bool:
    return bool(inputs[name].max(initial=0) < 2 ** inputs["bit_depth"])


def _finite_halves(bits: Any) -> bool:
    return bool(np.all(bits & 0x7C00 != 0x7C00))


def _values_are_finite(inputs: Values) -> bool:
    """Whether the values of codes (10-17) are finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        values = inputs["codes"].astype(np.float32) * inputs["scale"] + inputs["offset"]
    return bool(np.isfinite(values).all())


def _result_is_finite(name: str) -> Callable[[Values], bool]:
    """Whether every parameter that a block's codes stand for is finite."""

    def holds(inputs: Values) -> bool:
        with np.errstate(all="ignore"):
            expected = operations()[name].oracle(**inputs)
        values = [output.value for output in expected.values() if isinstance(output, Exact)]
        return all(np.isfinite(value).all() for value in values)

    return holds


def _is_legal(inputs: Values) -> bool:
    # Only who makes vectors asks this. The document's own decoder would take minutes for the largest streams.
    from gsvc_ref.stream import reconstruct_layers

    return not reconstruct_layers(inputs["stream"], inputs.get("layer", 0)).error


def _plane_is_sound(inputs: Values) -> bool:
    import gsvc_ref  # as in `_is_legal`
    from gsvc_base.errors import GsvcError

    try:
        gsvc_ref.decode_plane(**inputs)
    except GsvcError:
        return False
    return True


def _below_sizes(indices: str) -> Rule:
    return (
        f"every number of {indices} must be below the size of its codebook",
        lambda i: np.all(i[indices] < i["codebook_sizes"]),
    )


def _sizes_add_up(rows: str) -> Rule:
    return (
        f"{rows} must have as many rows as codebook_sizes adds up to",
        lambda i: i["codebook_sizes"].sum() == len(i[rows]),
    )


STAGES: Final[Rule] = (
    f"there must be 1 to {MAX_STAGES} stages of codebooks",
    lambda i: 1 <= len(i["codebook_sizes"]) <= MAX_STAGES,
)


def _enough_uniforms(inputs: Values) -> bool:
    """Whether there is a uniform number for each codeword that dies."""
    first, dead = 0, 0
    for k, size in enumerate(inputs["codebook_sizes"].tolist()):
        users = np.bincount(inputs["indices"][:, k], minlength=size)
        counts = inputs["decay"] * inputs["counts"][first : first + size] + (1 - inputs["decay"]) * users
        dead += int(np.count_nonzero(counts < inputs["dead_count"]))
        first += size
    return len(inputs["indices"]) == 0 or len(inputs["uniforms"]) >= dead


def _chroma_fits(inputs: Values, height: int, width: int) -> bool:
    """Whether the colour planes have the sizes of section 11.1."""
    down, across = {1: (2, 2), 2: (1, 2), 3: (1, 1)}[inputs["chroma_format"]]
    size = (-(-height // down), -(-width // across))
    return bool(inputs["cb"].shape == inputs["cr"].shape == size)


def _codes(name: str) -> tuple[Rule, ...]:
    """The rows of the operations that reconstruct blocks."""
    return (
        (STAGES[0], lambda i: len(i["color_indices"]) == 0 or STAGES[1](i)),
        _sizes_add_up("codewords"),
        ("a cholesky scale that is used must be at least 2^-126 (R-6.5-5)",
         lambda i: len(i["cholesky"]) == 0 or np.all(i["scale"] >= SMALLEST_NORMAL)),
        ("positions must be binary16 patterns of finite numbers (R-6.5-7)", lambda i: _finite_halves(i["positions"])),
        ("codewords must be binary16 patterns of finite numbers (R-3.1-2)", lambda i: _finite_halves(i["codewords"])),
        _below_sizes("color_indices"),
        ("every parameter of the result must be finite (R-8-1)", _result_is_finite(name)),
    )  # fmt: skip


MATRIX: Final[tuple[Rule, ...]] = (
    ("matrix_coefficients must be one that section 11.1 converts: 0, 1, 2 or 4 to 9",
     lambda i: i["matrix_coefficients"] in CONVERTED),
    ("chroma_format must be 1 to 3, and 3 where matrix_coefficients is 0",
     lambda i: i["chroma_format"] in ((3,) if i["matrix_coefficients"] == 0 else (1, 2, 3))),
)  # fmt: skip

LEGAL: Final[Rule] = (
    "stream must be legal: gsvc-conformance check says why it is not; operations with an output error take any bytes",
    _is_legal,
)
SCALE: Final[Rule] = ("scale must be above 0", lambda i: np.all(i["scale"] > 0))
BITS: Final[Rule] = ("bits must be 1 to 16", lambda i: 1 <= i["bits"] <= 16)


def _scales_in_range(inputs: Values) -> bool:
    a, e = inputs["new_width"] / inputs["width"], inputs["new_height"] / inputs["height"]
    return bool(np.all(abs(inputs["parameters"][:, :5] * np.array([a, e, a, e, e])) <= 2.0**126))


def _of_main(inputs: Values) -> bool:
    return stated_profile(inputs["stream"]) == "main"


def _in_state(inputs: Values) -> bool:
    """Whether states are in the ranges of section 15.4."""
    code = namespace()
    lowest = [-code["X_MOST"]] * 2 + [code["A_LEAST"]] * 2 + [-code["S_MOST"]] + [-code["N_MOST"]] * 3
    highest = [code["X_MOST"]] * 2 + [code["A_MOST"]] * 2 + [code["S_MOST"]] + [code["N_MOST"]] * 3
    return bool(np.all((inputs["state"] >= lowest) & (inputs["state"] <= highest)))


def _classes_of(inputs: Values) -> tuple[Any, Any]:
    """The class of each splat of main_intra, and the bits of its place (N, 2)."""
    code = namespace()
    D = code["step_of"](inputs["quantizer"])
    j = code["classes"](code["coded_colors"](inputs["colors"], D), D)
    bits = [2 - code["place_step"](inputs["shapes"].T, j, sign) for sign in (1, -1)]
    return j, np.stack(bits, axis=1)


def _in_windows(inputs: Values) -> bool:
    """Whether a density has each code of size, aspect and shear in its window."""
    code = namespace()
    j, _ = _classes_of(inputs)
    for plane, codes in enumerate(inputs["shapes"].T):
        h = code["h_shear" if plane == SHEAR else "h_size"]
        slopes = (0, 0) if plane == SHEAR else (-128, 127)
        ends = [
            [_end_of_window(64 * centre + 16 * slope * c, h(c), last) for c in range(code["CLASS_MOST"] + 1)]
            for last, (centre, slope) in enumerate(zip((-512, 511), slopes, strict=True))
        ]
        if np.any((codes < np.array(ends[0])[j]) | (codes > np.array(ends[1])[j])):
            return False
    return True


def _end_of_window(centre: int, h: int, last: int) -> int:
    """The first or last code of the widest window (15-7) about a centre."""
    bins, r, first = namespace()["window_density"](namespace()["LOGISTIC"], 31, centre, h)
    return int(((first + len(bins) - 1) << r) - 1 if last else first << r)


def _parts_of(inputs: Values) -> int:
    """How many numbers the parts of all halvings need; more than there are if these are too few."""
    code, parts, needed = namespace(), [((0, 0), inputs["count"])], 0
    for axis, size, inside in code["halvings"](inputs["width"], inputs["height"]):
        numbers = inputs["first_halves"][needed : needed + len(parts)].tolist()
        needed += len(parts)
        if len(numbers) == len(parts):
            parts = code["parts_halved"](parts, axis, size, inside, numbers)
    return needed


def _field_fits(inputs: Values) -> bool:
    """Whether there are as many vectors as a frame has cells."""
    rows, columns, _ = inputs["vectors"].shape
    side = namespace()["SIDES"][inputs["motion_cell"]]
    if side == 0:
        return bool(rows * columns == 0)
    if "width" in inputs:
        return bool((columns, rows) == (-(-inputs["width"] // side), -(-inputs["height"] // side)))
    return bool(min(rows, columns) >= 1 and max(rows, columns) <= -(-MAX_SIDE // side))


SHEAR: Final = 2
"""The column of shear in the codes of shapes."""

STATES: Final[Rule] = ("states must be in the ranges of section 15.4", _in_state)
COUNTS: Final[tuple[Rule, ...]] = (
    ("there must be a context, and 2 to 24 symbols",
     lambda i: len(i["counts"]) >= 1 and 2 <= i["counts"].shape[1] <= 24),
    ("no count may be negative", lambda i: np.all(i["counts"] >= 0)),
    ("each context must have counts that add up to 1 to 2^32 - 1",
     lambda i: np.all((i["counts"].sum(axis=1) >= 1) & (i["counts"].sum(axis=1) < 2**32))),
)  # fmt: skip
FIELD: Final[Rule] = (
    "there must be as many vectors as the frame has cells, or, where motion_cell is 0, none",
    _field_fits,
)

ROWS: Final[Mapping[str, tuple[Rule, ...]]] = {
    "read_stream": (LEGAL,),
    "decode_stream": (LEGAL,),
    "decode_stream_deterministic": (LEGAL,),
    "decode_layers": (LEGAL,),
    "seek": (("0 <= first <= last < 2^32 must hold", lambda i: 0 <= i["first"] <= i["last"] < 2**32),),
    "decode_plane": (
        ("count must be at least 1", lambda i: i["count"] >= 1),
        ("data must begin with a plane(count, alphabet) without a fault", _plane_is_sound),
    ),
    "encode_plane": (
        ("there must be a symbol", lambda i: len(i["symbols"]) > 0),
        (f"alphabet must be 1 to {MAX_ALPHABET}", lambda i: 1 <= len(i["frequencies"]) <= MAX_ALPHABET),
        ("every symbol must be below the number of frequencies",
         lambda i: i["symbols"].max(initial=0) < len(i["frequencies"])),
        ("the frequencies must be at least 0 and add up to 2^entropy_precision",
         lambda i: np.all(i["frequencies"] >= 0) and i["frequencies"].sum() == 2 ** i["entropy_precision"]),
        ("every symbol must have a frequency above 0",
         lambda i: np.all(i["frequencies"][np.minimum(i["symbols"], len(i["frequencies"]) - 1)] > 0)),
    ),
    "from_half": (
        ("no pattern may be that of a NaN",
         lambda i: not np.any((i["bits"] & 0x7C00 == 0x7C00) & (i["bits"] & 0x3FF != 0))),
    ),
    "to_half": (
        ("every value must round to a finite binary16, so be below 65520 in magnitude",
         lambda i: np.all(abs(i["values"]) < 65520)),
    ),
    "reconstruct_intra": _codes("reconstruct_intra"),
    "reconstruct_inter": (
        ("survivors must be 0 or 1", lambda i: np.all(i["survivors"] <= 1)),
        ("positions, cholesky and color_indices must each have a row for each survivor, or none",
         lambda i: all(len(i[name]) in (0, np.count_nonzero(i["survivors"]))
                       for name in ("positions", "cholesky", "color_indices"))),
        *_codes("reconstruct_inter"),
    ),
    "scale_parameters_filtered": (("no product of (9-8) may exceed 2^126 in magnitude", _scales_in_range),),
    "learning_rates": (
        ("iterations must be at least 0", lambda i: np.all(i["iterations"] >= 0)),
        ("factor must be above 0 and at most 1", lambda i: 0 < i["factor"] <= 1),
    ),
    "adan_step": (
        ("n must be at least 0", lambda i: np.all(i["n"] >= 0)),
        ("steps must be at least 0", lambda i: np.all(i["steps"] >= 0)),
        ("epsilon must be above 0", lambda i: i["epsilon"] > 0),
        ("no gradient times its unit may be above 2^62 in magnitude",
         lambda i: np.all(abs(i["gradients"].astype(np.float64) * i["units"]) <= 2.0**62)),
    ),
    "pruning_plan": (
        ("splats and iterations must be at least 0", lambda i: min(i["splats"], i["iterations"]) >= 0),
        ("fraction must be at least 0 and below 1", lambda i: 0 <= i["fraction"] < 1),
        ("1 <= first <= last must hold", lambda i: 1 <= i["first"] <= i["last"]),
    ),
    "prune": (("removed must be 0 to N", lambda i: 0 <= i["removed"] <= len(i["weights"])),),
    "compact": (
        ("survivors must grow, and be 0 to N - 1",
         lambda i: np.all(np.diff(i["survivors"], prepend=-1, append=len(i["steps"])) > 0)),
    ),
    "select_key_frames": (
        ("losses_i must have a frame at least", lambda i: len(i["losses_i"]) >= 1),
        ("window and threshold must be at least 0", lambda i: min(i["window"], i["threshold"]) >= 0),
    ),
    "lsq_quantize": (SCALE, BITS),
    "lsq_gradients": (SCALE, BITS),
    "lsq_dequantize": (SCALE, ("the values must be finite", _values_are_finite)),
    "rvq_assign": (
        STAGES,
        _sizes_add_up("codebooks"),
        (f"x and codebooks must be at most {LARGEST_HALF:g} in magnitude",
         lambda i: max(abs(i["x"]).max(initial=0), abs(i["codebooks"]).max(initial=0)) <= LARGEST_HALF),
    ),
    "rvq_update": (
        STAGES,
        _sizes_add_up("codebooks"),
        _below_sizes("indices"),
        ("counts and smoothing must be at least 0", lambda i: np.all(i["counts"] >= 0) and i["smoothing"] >= 0),
        ("uniforms must be at least as many as dead codewords", _enough_uniforms),
    ),
    "commitment": (STAGES, _sizes_add_up("codebooks"), _below_sizes("indices")),
    "planes_to_frame": (
        *MATRIX,
        ("cb and cr must have the size of section 11.1: half of y's columns in 4:2:0 and 4:2:2, half of its rows in "
         "4:2:0, rounded up", lambda i: i["chroma_format"] not in (1, 2, 3) or _chroma_fits(i, *i["y"].shape)),
    ),
    "frame_to_planes": MATRIX,
    "read_main_stream": (LEGAL, ("stream must be of profile main", _of_main)),
    "encode_run": (
        ("every frequency must be above 0", lambda i: np.all(i["frequencies"] >= 1)),
        ("starts must be at least 0, and no start and its frequency may add up to more than 2^14",
         lambda i: np.all((i["starts"] >= 0) & (i["starts"] + i["frequencies"] <= 2**14))),
        ("every lane must be below lane_count", lambda i: np.all((i["lanes"] >= 0) & (i["lanes"] < i["lane_count"]))),
        ("lane_count must be a power of two up to 2^12",
         lambda i: i["lane_count"] <= 2**12 and i["lane_count"].bit_count() == 1),
        *((f"{name} must be 0 to 28, and raw values be in them",
           lambda i, name=name: np.all((i[name] >= 0) & (i[name] <= 28) & (i[name[:-6]] >> i[name] == 0)))
          for name in ("early_sizes", "late_sizes")),
    ),
    "window_frequencies": (
        ("centre must be below 2^16 in magnitude", lambda i: abs(i["centre"]) < 2**16),
        ("step must be 1 to 2048", lambda i: 1 <= i["step"] <= 2048),
        ("scale_code must be 0 to 31", lambda i: 0 <= i["scale_code"] < 32),
    ),
    "density_frequencies": (
        ("edges must grow", lambda i: np.all(np.diff(i["edges"]) > 0)),
        ("edges must be even or odd together", lambda i: len(set((i["edges"] & 1).tolist())) < 2),
        ("there must be at most 2^10 edges", lambda i: len(i["edges"]) <= 2**10),
        ("centre must be below 2^16 in magnitude, and no edge more than 2^16 from twice the centre",
         lambda i: max(abs(i["edges"] - 2 * i["centre"]).max(initial=0), abs(i["centre"]) + 1) <= 2**16),
    ),
    "codes_of_classes": (
        ("classes must be 0 to 39", lambda i: np.all((i["classes"] >= 0) & (i["classes"] < 40))),
        ("low must be in the bits of its class",
         lambda i: np.all(i["low"] >> namespace()["low_bits"](i["classes"]) == 0)),
        ("negative must be 0 or 1", lambda i: np.all(i["negative"] >> 1 == 0)),
    ),
    "half_frequencies": (
        ("count must be 1 to 2^22 - 1", lambda i: 1 <= i["count"] < 2**22),
        ("1 <= second_half <= first_half < 2^14 must hold, and first_half must be a power of two",
         lambda i: 1 <= i["second_half"] <= i["first_half"] < 2**14 and i["first_half"].bit_count() == 1),
        ("alpha must be one of those of section 15.7", lambda i: i["alpha"] in namespace()["ALPHAS"]),
    ),
    "cells_of_halves": (
        ("count must be 1 to 2^22 - 1", lambda i: 1 <= i["count"] < 2**22),
        ("first_halves must be at least 0 and below 2^23, a number for each part with splats in each halving",
         lambda i: np.all(i["first_halves"] >> 23 == 0) and len(i["first_halves"]) == _parts_of(i)),
    ),
    "field_vectors": (
        ("there must be 1 to 4096 rows and columns", lambda i: all(1 <= n <= 4096 for n in i["differences"].shape[:2])),
        ("differences must be below 2^12 in magnitude", lambda i: np.all(abs(i["differences"]) < 2**12)),
    ),
    "model_frequencies": COUNTS,
    "adapt_model": COUNTS,
    "mode_contexts": (STATES, FIELD),
    "motion_of_splats": (STATES, ("motion_cell must be 1 to 3", lambda i: i["motion_cell"] >= 1), FIELD),
    "splat_classes": (STATES,),
    "main_intra": (
        ("cells must be 0 to 2^14 - 1", lambda i: np.all((i["cells"] >= 0) & (i["cells"] < 2**14))),
        ("shapes must be in windows of section 15.7", _in_windows),
        ("places must be in their bits",
         lambda i: np.all((i["places"] >= 0) & (i["places"] < 1 << _classes_of(i)[1]))),
    ),
    "main_inter": (STATES,),
    "state_parameters": (STATES,),
    "main_work": (STATES, ("halvings must be 0 to 3", lambda i: 0 <= i["halvings"] <= 3)),
    "encode_video": (
        ("there must be a frame, and a splat", lambda i: min(len(i["frames"]), i["splats"]) >= 1),
        ("the level must allow so many pixels", lambda i: i["frames"][0, ..., 0].size <= LIMITS[i["level"]]["pixels"]),
        ("the level must allow so many splats", lambda i: i["splats"] <= LIMITS[i["level"]]["splats"]),
    ),
}  # fmt: skip
"""What the row of an operation in the table of preconditions asks for beyond the last row, in its order."""
