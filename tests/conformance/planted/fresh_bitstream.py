"""Mutants of decoders and of the reconstruction of splats, written without a look at what the kit says."""

import numpy as np

from planted import after, before, patched

STREAM = "reconstruct_stream"
LOW = "    bits = high * 256 + low\n"

RECONSTRUCTION = (
    patched("bitstream", "positions from pixel centres", "reconstruct_intra", r"(?i)0\.5|1/2|half a|pixel centre|offset|shift|minus",
            ("        mu = (half_values(positions) + np.float32(1)) * half_size(width, height)  # (8-1), (8-2)\n        L = dequantized",
             "        mu = (half_values(positions) + np.float32(1)) * half_size(width, height) - np.float32(0.5)\n        L = dequantized")),
    patched("bitstream", "normalised positions with y upwards", "reconstruct_intra", r"(?i)flip|mirror|upward|\by\b|sign",
            ("        mu = (half_values(positions) + np.float32(1)) * half_size(width, height)  # (8-1), (8-2)\n        L = dequantized",
             "        mu = (half_values(positions) * np.array([1, -1], np.float32) + np.float32(1)) * half_size(width, height)\n        L = dequantized")),
    patched("bitstream", "survivors taken from the front", "reconstruct_inter", r"(?i)surviv|first|rows|map|reference",
            ("parameters = reference[survivors == 1]", "parameters = reference[: int(np.sum(survivors))]")),
    patched("bitstream", "differences of positions from the middle", "reconstruct_inter", r"(?i)W/2|middle|\+ 1|half the|width|centre|shift|intra|offset|position",
            ("            mu = mu + half_values(positions) * half_size", "            mu = mu + (half_values(positions) + np.float32(1)) * half_size")),
    patched("bitstream", "codebooks as large as the first", "reconstruct_intra reconstruct_inter", r"(?i)sizes?\b|stage|codebook|codeword",
            ("        chosen = values[first + color_indices[:, k].astype(np.int64)]",
             "        chosen = values[np.minimum(k * int(codebook_sizes[0]) + color_indices[:, k].astype(np.int64), len(values) - 1)]")),
    patched("bitstream", "stages summed from the last", "reconstruct_intra reconstruct_inter", r"(?i)order|stage|revers|last",
            ("        chosen = values[first + color_indices[:, k].astype(np.int64)]\n        colors = chosen if k == 0 else colors + chosen\n        first += int(size)\n    return colors",
             "        chosen = values[first + color_indices[:, k].astype(np.int64)]\n        parts = [chosen] if k == 0 else [*parts, chosen]\n        first += int(size)\n"
             "    colors = parts[-1]\n    for part in parts[-2::-1]:\n        colors = colors + part\n    return colors")),
    patched("bitstream", "subnormal halves of half the size", "from_half", r"(?i)subnormal|denormal", ("np.ldexp(1.0 * fraction, -24)", "np.ldexp(1.0 * fraction, -25)")),
    patched("bitstream", "halves cut, not rounded", "to_half", r"(?i)trunc|toward|cut|round|down", ("steps = np.rint(np.ldexp(magnitude, 10 - exponent))", "steps = np.floor(np.ldexp(magnitude, 10 - exponent))")),
    after("bitstream", "halves of at most 65504", "to_half", r"(?i)65504|infinit|satur|overflow|largest",
          lambda o, i: {"bits": np.where((o["bits"] & 0x7FFF) == 0x7C00, o["bits"] - 1, o["bits"]).astype(np.uint16)}),
    patched("bitstream", "a checksum of rows", "parameter_checksum", r"(?i)\brows?\b|interleav|splat by splat|order",
            ("    data = stored[:, 0:2].tobytes() + stored[:, 2:5].tobytes() + stored[:, 5:8].tobytes()", "    data = stored.tobytes()")),
    patched("bitstream", "a register that begins with zeros", "parameter_checksum", r"(?i)begin|init|start|register|seed", ("    register = 0xFFFFFFFF\n", "    register = 0\n")),
    patched("bitstream", "lengths below one kept positive", "reconstruct_inter", r"(?i)negative|clamp|below|at least|posit|magnitude|abs",
            ("            L = L + dequantized(cholesky, scale, offset)  # (8-3)", "            L = abs(L + dequantized(cholesky, scale, offset))")),
)  # fmt: skip

DECODERS = (
    patched("bitstream", "numbers of four bytes at most", STREAM, r"(?i)\buv\b|five|5 bytes|four|R-3\.1-1|bytes", ("for group in range(5):", "for group in range(4):")),
    patched("bitstream", "numbers with a sign", STREAM, r"(?i)2\^31|\buv\b|sign|31 bits|R-3\.1-1", ("byte >= 0x80 or value >= 2**32", "byte >= 0x80 or value >= 2**31")),
    patched("bitstream", "halves that are infinite", STREAM, r"(?i)R-3\.1-2|infinit|binary16|\bhalf|f16",
            ("        if bits & 0x7C00 == 0x7C00:  # R-3.1-2\n            raise Fault(\"R-3.1-2\", self.element)\n        return bits", "        return bits")),
    patched("bitstream", "every unknown chunk refused", STREAM + " read_stream", r"(?i)unknown|ancillary|lower|chunk|R-3\.2-1",
            ("    if chunk_type.isupper() and chunk_type not in CRITICAL:", "    if chunk_type not in CRITICAL + 'x':")),
    patched("bitstream", "a checksum of the payload only", STREAM + " read_stream", r"(?i)crc|checksum|R-6\.2-2", ("    if compare_crc and chunk_crc != crc32c(covered):", "    if compare_crc and chunk_crc != crc32c(payload):")),
    patched("bitstream", "newer minor versions refused", STREAM + " read_stream", r"(?i)minor|version",
            ("    version_minor = s.le(1)\n", "    version_minor = s.le(1)\n    if version_minor != 0:\n        raise Fault('R-6.1-2', s.element)\n")),
    patched("bitstream", "a word taken at the lowest state, too", "decode_plane", r"(?i)state|renorm|word|2\^16|R-7-1|65536",
            ("        if x < LOWEST_STATE:\n            if taken", "        if x <= LOWEST_STATE:\n            if taken")),
    patched("bitstream", "lanes from the last to the first", "decode_plane", r"(?i)lane|states?", ("        j = i % len(states)\n        x = states[j]\n        slot", "        j = -1 - i % len(states)\n        x = states[j]\n        slot")),
    patched("bitstream", "frequencies that are not scaled up", "decode_plane", r"(?i)scale|shift|table_bits|frequenc|precision", ("[frequency << (precision - table_bits) for", "[frequency for")),
    patched("bitstream", "Golomb codes with a prefix of order 0", "decode_plane", r"(?i)golomb|\beg\b|order|prefix|frequenc", ("return ((2**z - 1) << k) + r", "return (2**z - 1) + r")),
    patched("bitstream", "the next plane in the same byte", STREAM + " read_stream", r"(?i)align|byte|pad", ("    p.align()\n    return symbols", "    return symbols")),
    patched("bitstream", "low bytes with a sign", "read_stream", r"(?i)sign|low byte|negative|position", (LOW, "    bits = (high * 256 + low.astype(np.uint8).astype(np.int8)).astype(np.uint16)\n")),
    patched("bitstream", "what was kept outlives an I-frame", STREAM + " read_stream", r"(?i)kept|keep|I-frame|forg|R-6\.5-[89]|quantis|codebook",
            ('        self.kept = {"intra": {}, "inter": {}}', '        self.kept = getattr(self, "kept", {"intra": {}, "inter": {}})')),
    patched("bitstream", "repeated frames without splats", STREAM, r"(?i)R-frame|repeat|R frames", ('        return state.parameters\n    size', '        return state.parameters[:0]\n    size')),
    patched("bitstream", "a one in the map for a splat that is gone", STREAM, r"(?i)surviv|\bmap\b",
            ('        frame["survivors"] = read_plane(p, state.header, reference_count, 2)', '        frame["survivors"] = 1 - read_plane(p, state.header, reference_count, 2)')),
    patched("bitstream", "an index that may not begin at frame 0", STREAM, r"(?i)index|R-6\.7-1|entry", ("grows = entry == 0 or (", "grows = (")),
    patched("bitstream", "an end that is not counted", STREAM, r"(?i)R-6\.8-1|frame_count|\bend\b", ("    if frame_count != state.next_number:  # R-6.8-1\n        raise Fault(\"R-6.8-1\", frame_count_bit)\n", "")),
    patched("bitstream", "height before width", STREAM + " read_stream", r"(?i)width|height|header",
            ('    ("width", 2, 1, 65535),\n    ("height", 2, 1, 65535),\n', '    ("height", 2, 1, 65535),\n    ("width", 2, 1, 65535),\n'),
            ('if name == "height" and header["width"] * value >', 'if name == "width" and header["height"] * value >')),
    patched("bitstream", "words in the order of encoding", "encode_plane", r"(?i)order|revers|words", (" + cumulative[s]  # (7-2)\n    words.reverse()\n", " + cumulative[s]  # (7-2)\n")),
    patched("bitstream", "states that may reach their limit", "encode_plane", r"(?i)renorm|words?|limit|state|emit|<<", ("while x >= frequencies[s] <<", "while x > frequencies[s] <<")),
    patched("bitstream", "new splats alone against the limit", STREAM, r"(?i)R-5-2|limit|splats", ("    if survivor_count + new_splat_count > state", "    if new_splat_count > state")),
    patched("bitstream", "every fault is invalid", STREAM, r"(?i)kind|invalid", ("        if rule in rules:\n            return kind\n", "        pass\n")),
    patched("bitstream", "the sum of differences rounded to halves", STREAM, r"(?i)binary16|\bhalf|round|few bits|precision",
            ('    return np.concatenate(parts)\n', '    with np.errstate(over="ignore"):\n        return np.concatenate(parts).astype(np.float16).astype(np.float32)\n')),
    before("bitstream", "planes without their first two bits", "decode_plane", r"(?i)bits|mode|shift|refus|raise|error",
           lambda i: {"data": np.packbits(np.concatenate([np.unpackbits(i["data"])[2:], np.zeros(2, np.uint8)]))}),
    patched("bitstream", "R-frames predicted from the frame before last", STREAM, r"(?i)R-frame|repeat|frame before|last",
            ("    state.parameters = parameters\n", "    state.older, state.parameters = state.parameters, parameters\n"),
            ('        return state.parameters\n    size', '        return getattr(state, "older", state.parameters)\n    size')),
)  # fmt: skip

PLANTED = (*RECONSTRUCTION, *DECODERS)
