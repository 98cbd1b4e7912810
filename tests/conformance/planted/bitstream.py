"""Mutants of reading streams, entropy coding and reconstruction."""

import numpy as np

from planted import after, patched

AREA = "bitstream"
RECONSTRUCTION = "reconstruction"

PLANTED = (
    patched(AREA, "frequencies not scaled", "decode_plane", "frequenc|table_bits", ("return [0] * first_symbol + [frequency << (precision - table_bits) for frequency in table]", "return [0] * first_symbol + list(table) + [0] * 0")),
    patched(AREA, "lanes in blocks", "decode_plane", "lane", ("        j = i % len(states)\n        x = states[j]\n        slot", "        j = i * len(states) // count\n        x = states[j]\n        slot")),
    patched(AREA, "words big-endian", "decode_plane", "other order|words|bytes|word", ("words = [p.le(2) for _ in range(word_count)]", "words = [(w := p.le(2)) // 256 + w % 256 * 256 for _ in range(word_count)]")),
    patched(AREA, "states big-endian", "decode_plane reconstruct_stream", "state|other order|bytes", ("        states.append(p.le(4))", "        states.append(int.from_bytes(p.le(4).to_bytes(4, 'big'), 'little'))")),
    patched(AREA, "renormalised at most", "decode_plane reconstruct_stream", "renormalis|2\\^16|word", ("        if x < LOWEST_STATE:\n            if taken", "        if x <= LOWEST_STATE:\n            if taken")),
    patched(AREA, "slot of 12 bits", "decode_plane", "entropy_precision|precision", ("slot = x % 2**precision", "slot = x % 2**12")),
    patched(AREA, "first symbol ignored", "decode_plane", "first_symbol|first symbol|smaller by|begins with symbol 0", ("return [0] * first_symbol + [", "return [")),
    patched(AREA, "golomb order 0", "decode_plane", "order 0|[Gg]olomb", ("table = [p.eg(golomb_order)", "table = [p.eg(0)")),
    patched(AREA, "width of alphabets", "decode_plane", "width|alphabet", ("w = (alphabet - 1).bit_length()", "w = alphabet.bit_length()")),
    patched(AREA, "no alignment after raw", "decode_plane", "padding|align|R-3.1-4", ("    p.align()\n    return symbols\n\n\ndef read_symbol", "    return symbols\n\n\ndef read_symbol")),
    after(AREA, "symbols first 64", "decode_plane", "symbols from 64", lambda out, i: (out["symbols"].__setitem__(np.s_[64:], 0), out)[1]),
    after(AREA, "symbols of 8 bits", "decode_plane", "256|8 bits", lambda out, i: {"symbols": out["symbols"] & np.uint16(255)}),
    after(AREA, "symbols last", "decode_plane", "last of the symbols", lambda out, i: (out["symbols"].__setitem__(np.s_[-1:], 0), out)[1]),
    after(AREA, "words reversed", "encode_plane", "reverse", lambda out, i: {"words": out["words"][::-1].copy()}),
    after(AREA, "lane states reversed", "encode_plane", "reverse|lane_states", lambda out, i: {"lane_states": out["lane_states"][::-1].copy()}),
    after(AREA, "lane states big-endian", "encode_plane", "other order", lambda out, i: {"lane_states": out["lane_states"].byteswap()}),
    patched(AREA, "encoder forward", "encode_plane", "order|forward|first symbol|reverse", ("for i in reversed(range(len(symbols))):", "for i in range(len(symbols)):")),
    patched(AREA, "crc of ieee", "reconstruct_stream", "CRC|checksum|chunk_crc", ("REFLECTED_POLYNOMIAL = 0x82F63B78", "REFLECTED_POLYNOMIAL = 0xEDB88320")),
    patched(AREA, "frame rate exchanged", "read_stream", "frame_rate", ('    ("frame_rate_numerator", 4, 1, 2**32 - 1),\n    ("frame_rate_denominator", 4, 1, 2**32 - 1),', '    ("frame_rate_denominator", 4, 1, 2**32 - 1),\n    ("frame_rate_numerator", 4, 1, 2**32 - 1),')),
    after(AREA, "denominator big-endian", "read_stream", "frame_rate_denominator", lambda out, i: (out["header"].__setitem__(6, int.from_bytes(int(out["header"][6]).to_bytes(4, "little"), "big")), out)[1]),
    after(AREA, "survivor bits reversed", "read_stream", "survivors", lambda out, i: {"survivors": np.concatenate([out["survivors"][k : k + 8][::-1] for k in range(0, len(out["survivors"]), 8)] or [out["survivors"]])}),
    after(AREA, "positions y x", "read_stream", "x and y exchanged|columns", lambda out, i: {"positions": out["positions"][:, ::-1].copy()}),
    after(AREA, "positions bytes", "read_stream", "other order|low byte of positions before the high", lambda out, i: {"positions": out["positions"].byteswap()}),
    after(AREA, "codewords B G R", "read_stream", "red and blue|reverse|B, G, R", lambda out, i: {"codewords": out["codewords"][:, ::-1].copy()}),
    patched(AREA, "indices by splat", "read_stream", "color_indices|splat", ('        block["color_indices"] = np.stack(planes, axis=1)', '        block["color_indices"] = np.stack(planes, axis=1).ravel().reshape(len(planes), -1).T')),
    patched(AREA, "nothing forgotten", "reconstruct_stream", "R-6.5-4|I-frame|kept", ('        self.kept = {"intra": {}, "inter": {}}', '        self.kept = getattr(self, "kept", {"intra": {}, "inter": {}})')),
    patched(AREA, "limits one less", "reconstruct_stream", "R-5-2|splat_count|limit", ('    if splat_count > state.limits["splats"]:  # R-5-2', '    if splat_count >= state.limits["splats"]:')),
    patched(AREA, "reserved bits ignored", "reconstruct_stream", "R-6.5-1|reserved", ("    if block_reserved != 0:  # R-6.5-1\n", "    if False:\n")),
    patched(AREA, "end count ignored", "reconstruct_stream", "R-6.8-1|frame_count|frame count at the end", ("    if frame_count != state.next_number:  # R-6.8-1\n", "    if False:\n")),
    patched(AREA, "index not checked", "reconstruct_stream", "R-6.7-1|index", ("        if not grows or offset >= index_offset:  # R-6.7-1\n", "        if False:\n")),
    after(RECONSTRUCTION, "half subnormals flushed", "from_half", "subnormal", lambda out, i: {"values": np.where(abs(out["values"]) < 2.0**-14, np.float32(0), out["values"])}),
    after(RECONSTRUCTION, "half bias 16", "from_half", "half the right|1/2|half", lambda out, i: {"values": out["values"] * np.float32(0.5)}),
    after(RECONSTRUCTION, "half unsigned", "from_half", "negative", lambda out, i: {"values": abs(out["values"])}),
    patched(RECONSTRUCTION, "half cut", "to_half", "cut|down|truncat|rounded", ("steps = np.rint(np.ldexp(magnitude, 10 - exponent))", "steps = np.floor(np.ldexp(magnitude, 10 - exponent))")),
    patched(RECONSTRUCTION, "half ties up", "to_half", "ties|half up", ("steps = np.rint(np.ldexp(magnitude, 10 - exponent))", "steps = np.floor(np.ldexp(magnitude, 10 - exponent) + 0.5)")),
    after(RECONSTRUCTION, "half bytes", "to_half", "other order", lambda out, i: {"bits": out["bits"].byteswap()}),
    after(RECONSTRUCTION, "intra first 16", "reconstruct_intra", "splats from 16", lambda out, i: (out["parameters"].__setitem__(np.s_[16:], 0), out)[1]),
    after(RECONSTRUCTION, "intra last", "reconstruct_intra", "last of the splats", lambda out, i: (out["parameters"].__setitem__(np.s_[-1:], 0), out)[1]),
    after(RECONSTRUCTION, "intra l11 l22 l21", "reconstruct_intra", "l21 and l22 exchanged|l11, l22, l21", lambda out, i: {"parameters": out["parameters"][:, [0, 1, 2, 4, 3, 5, 6, 7]].copy()}),
    patched(RECONSTRUCTION, "width twice", "reconstruct_intra", "\\by\\b|width|height", ("return np.array([width, height], np.float32) / np.float32(2)", "return np.array([width, width], np.float32) / np.float32(2)")),
    patched(RECONSTRUCTION, "offset before scale", "reconstruct_intra", "offset|l11, l21, l22", ("return cholesky.astype(np.float32) * scale + offset", "return (cholesky.astype(np.float32) + offset) * scale")),
    patched(RECONSTRUCTION, "codes of 8 bits", "reconstruct_intra", "8 bits|l11|256", ("return cholesky.astype(np.float32) * scale", "return (cholesky & 255).astype(np.float32) * scale")),
    patched(RECONSTRUCTION, "first stage only", "reconstruct_intra", "stage|red, green, blue", ("colors = chosen if k == 0 else colors + chosen", "colors = chosen if k == 0 else colors")),
    patched(RECONSTRUCTION, "inter ignores survivors", "reconstruct_inter", "surviv", ("    parameters = reference[survivors == 1]  # R-6.4-5\n    mu, L", "    parameters = reference[: int(np.sum(survivors))]\n    mu, L")),
    patched(RECONSTRUCTION, "inter positions absolute", "reconstruct_inter", "\\bx, y\\b|position|intra", ("            mu = mu + half_values(positions) * half_size(width, height)", "            mu = half_values(positions) * half_size(width, height)")),
    patched(RECONSTRUCTION, "inter colours replaced", "reconstruct_inter", "colour|red, green, blue", ("            c = c + codeword_sum(color_indices, codebook_sizes, codewords)", "            c = codeword_sum(color_indices, codebook_sizes, codewords)")),
    patched(RECONSTRUCTION, "checksum of rows", "parameter_checksum", "splat by splat|row", ('stored[:, 0:2].tobytes() + stored[:, 2:5].tobytes() + stored[:, 5:8].tobytes()', 'stored.tobytes()')),
    patched(RECONSTRUCTION, "work in 32 bits", "rendering_work", "32 bits", ('np.array(np.sum((right - left) * (bottom - top)), np.int64)}  # (5-1)', 'np.array(np.int32(int(np.sum((right - left) * (bottom - top))) % 2**32 - (2**32 if int(np.sum((right - left) * (bottom - top))) % 2**32 >= 2**31 else 0)), np.int64)}')),
    after(RECONSTRUCTION, "work of the last splat", "rendering_work", "last of the splats left out|splats", lambda out, i: {"work": out["work"] - _last_box(i)} if len(i["parameters"]) else out),
)  # fmt: skip


def _last_box(inputs):
    from gsvc_conformance import spec

    names = spec.namespace()
    left, right, top, bottom = names["boxes"](
        inputs["parameters"][-1:], inputs["width"], inputs["height"], names["REACH"]
    )[0]
    return (right - left) * (bottom - top)
