"""Mutants of seeking: what is believed, checked, counted or kept wrongly on the way to a frame."""

from gsvc_conformance.mutants.mutant import Mutant, mutant

AREA = "seeking"

BY_INDEX = """def entries(p):
    number = offset = 0
    for _ in range(p.uv()):
        number += p.uv()
        offset += p.uv()
        yield number, offset


def find_by_index(s, state, first):
    at = s.at
    try:
        s.at = 8 * (len(s.data) - 14)
        index_length = int.from_bytes(read_chunk(s, 8)[1].data[4:], "little")
        s.at = 8 * (len(s.data) - 14 - index_length)
        _, p = read_chunk(s, state.limits["payload"])
        named = [entry for entry in entries(p) if entry[0] <= first][-1]
        s.at = 8 * named[1]
        chunk_type, p = read_chunk(s, state.limits["payload"])
        assert chunk_type == "I" and p.uv() == named[0]
        s.at, state.next_number = 8 * named[1], named[0]
    except (Fault, IndexError, AssertionError):
        s.at = at
        find(s, state, first)


def frames_between("""

MUTANTS: tuple[Mutant, ...] = (
    mutant(AREA, "index-believed", "an entry of the index taken for true because a whole I-frame of its number is there",
        ("        find(s, state, first)\n", "        find_by_index(s, state, first)\n"), ("def frames_between(", BY_INDEX)),
    mutant(AREA, "hop-compares-crc", "checksums compared while hopping",
        ("compare_crc=False)\n    check_known", "compare_crc=True)\n    check_known")),
    mutant(AREA, "hop-reads-frame-numbers", "frame numbers checked while hopping",
        ('    chunk_type, _ = read_chunk(s, state.limits["payload"], compare_crc=False)\n',
         '    chunk_type, p = read_chunk(s, state.limits["payload"], compare_crc=False)\n'
         '    if chunk_type in FRAMES and p.uv() != state.next_number:\n        raise Fault("R-6.4-1", p.element)\n')),
    mutant(AREA, "hop-reads-indices", "indices checked while hopping",
        ('    chunk_type, _ = read_chunk(s, state.limits["payload"], compare_crc=False)\n',
         '    chunk_type, p = read_chunk(s, state.limits["payload"], compare_crc=False)\n'
         '    if chunk_type == "x":\n        read_index(p, chunk_bit // 8)\n')),
    mutant(AREA, "hop-over-unknown", "unknown critical chunks hopped over",
        ("    check_known(chunk_type, chunk_bit)\n    check_may_stand(chunk_type, chunk_bit, state)\n    state.next_number",
         "    check_may_stand(chunk_type, chunk_bit, state)\n    state.next_number")),
    mutant(AREA, "hop-over-headers", "a second sequence header hopped over",
        ("    check_may_stand(chunk_type, chunk_bit, state)\n    state.next_number",
         '    if chunk_type != "H":\n        check_may_stand(chunk_type, chunk_bit, state)\n    state.next_number')),
    mutant(AREA, "hop-from-any-frame", "a first frame that is predicted hopped over",
        ("    check_may_stand(chunk_type, chunk_bit, state)\n    state.next_number",
         '    if chunk_type not in "PR":\n        check_may_stand(chunk_type, chunk_bit, state)\n    state.next_number')),
    mutant(AREA, "hop-counts-all-chunks", "ancillary chunks counted as frames",
        ("    state.next_number += chunk_type in FRAMES\n", '    state.next_number += chunk_type != "E"\n')),
    mutant(AREA, "hop-counts-i-and-p", "R-frames not counted",
        ("    state.next_number += chunk_type in FRAMES\n", '    state.next_number += chunk_type in "IP"\n')),
    mutant(AREA, "hop-counts-8-bits", "frames counted modulo 256",
        ("    state.next_number += chunk_type in FRAMES\n",
         "    state.next_number = (state.next_number + (chunk_type in FRAMES)) % 256\n")),
    mutant(AREA, "hop-forgets-index", "an index directly before the end chunk forgotten while hopping",
        ('    if chunk_type != "E":  # which', "    if True:  # which")),
    mutant(AREA, "hop-any-index", "any chunk before the end chunk taken for an index while hopping",
        ('        state.index_length = size if chunk_type == "x" else 0\n', "        state.index_length = size\n")),
    mutant(AREA, "seek-not-to-i-frame", "decoding begun at the frame itself, whatever its type",
        ('        if chunk_type in "IE":\n', '        if chunk_type in "IPRE":\n')),
    mutant(AREA, "seek-one-frame-late", "the I-frame after the frame taken for one before it",
        ("    while state.next_number <= first and", "    while state.next_number <= first + 1 and")),
    mutant(AREA, "seek-one-group-early", "an I-frame that is asked for decoded from the one before it",
        ('        if chunk_type in "IE":\n', '        if chunk_type == "E" or chunk_type == "I" and here[1] < max(first, 1):\n')),
    mutant(AREA, "seek-from-the-start", "all frames before decoded, too", ("    if first > 0:\n        find", "    if False:\n        find")),
    mutant(AREA, "seek-hops-to-frame-0", "hopping to the first frame, too", ("    if first > 0:\n        find", "    if True:\n        find")),
    mutant(AREA, "seek-number-of-the-frame", "any frame number of the I-frame accepted",
        ("    for frame in read_frames(s, state):\n        if frame",
         "    if first > 0:\n        at = s.at\n        _, p = read_chunk(s, state.limits[\"payload\"], compare_crc=False)\n"
         "        state.next_number, s.at = p.uv(), at\n    for frame in read_frames(s, state):\n        if frame")),
    mutant(AREA, "seek-last-exclusive", "the last frame left out",
        ('        if frame["frame_number"] >= first:\n            yield frame\n',
         '        if first <= frame["frame_number"] < last:\n            yield frame\n')),
    mutant(AREA, "seek-first-exclusive", "the first frame left out",
        ('        if frame["frame_number"] >= first:\n', '        if frame["frame_number"] > first:\n')),
    mutant(AREA, "seek-hands-out-all", "the frames from the I-frame on handed out",
        ('        if frame["frame_number"] >= first:\n', "        if True:\n")),
    mutant(AREA, "seek-reads-on", "what stands after the last frame looked at",
        ('        if frame["frame_number"] == last:\n            return\n', '        if frame["frame_number"] == last:\n            last = -1\n'),
        ('        if frame["frame_number"] >= first:\n', '        if frame["frame_number"] >= first and last >= 0:\n')),
    mutant(AREA, "seek-end-unchecked", "the end chunk not checked when there are fewer frames",
        ("        find(s, state, first)\n", "        find(s, state, first)\n        if state.next_number <= first and chr(s.data[s.at // 8]) == \"E\":\n            return\n")),
    mutant(AREA, "seek-judges-the-pace", "the pace of a paced stream judged while seeking",
        ("    state.frames_counted = None  # the sums of a second are not known\n", "    state.frames_counted = state.next_number\n    state.last_i_frame = 0\n")),
    mutant(AREA, "seek-beyond-the-end-refused", "a frame beyond the end taken for a fault of the stream",
        ('        if chunk_type in "IE":\n', '        if chunk_type == "E":\n            raise Fault("R-6.8-1", here[0])\n        if chunk_type in "IE":\n')),
    mutant(AREA, "seek-cut-accepted", "a cut stream taken for one that has fewer frames",
        ("        find(s, state, first)\n", "        try:\n            find(s, state, first)\n        except Fault as fault:\n"
         "            if fault.rule == \"R-6.2-4\":\n                return\n            raise\n")),
)  # fmt: skip
"""All of them."""
