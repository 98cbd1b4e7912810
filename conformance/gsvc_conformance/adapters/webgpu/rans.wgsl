// Entropy coding of one plane (spec.md, section 7): static rANS whose lanes run side by side.
//
//     pass      dispatch       bindings           what
//     spread    2^R / 256      0 1 2              the symbol of each slot
//     decode    1              0 1 2 3 4 5 6      (7-1): symbols of states and words
//     encode    1              0 1 3 5 6 7        (7-2): states and words of symbols
//
// Each of the last two goes through ROUNDS_AT_ONCE rounds (entropy.py), and is dispatched until all are done. The text
// of ballots.wgsl stands in front.
//
// Integers only, so WebGPU promises the same result everywhere. Planes do not depend on each other: a decoder that
// has found all planes of a frame (each says how long it is) gives each a workgroup of its own.

struct Plane {
    count: u32,                // symbols
    entropy_precision: u32,    // R. range: 12 to 16
    lane_count: u32,           // that are used: min(lane_count, count). range: a quotient takes at least 1
    word_count: u32,           // that there are
    alphabet: u32,             // symbols that have a frequency
    first_round: u32,          // of this dispatch, each round being a symbol of every lane
    rounds: u32,               // at most
}

@group(0) @binding(0) var<uniform> plane: Plane;
@group(0) @binding(1) var<storage, read> cumulative: array<u32>;              // c(s), and 2^R after the last one
@group(0) @binding(2) var<storage, read_write> symbol_of_slot: array<u32>;
@group(0) @binding(3) var<storage, read_write> states: array<u32>;            // of the lanes: at first, and in the end
@group(0) @binding(4) var<storage, read> words: array<u32>;                   // two words of 16 bits in each
@group(0) @binding(5) var<storage, read_write> symbols: array<u32>;
@group(0) @binding(6) var<storage, read_write> moved_words: array<u32>;       // how many words were needed or emitted
@group(0) @binding(7) var<storage, read_write> emitted: array<u32>;           // a word in each, the last one first

// An invocation for each slot: the last symbol with c(s) <= slot. Symbols of frequency 0 have the c(s) of the next one.
@compute @workgroup_size(256)
fn spread(@builtin(global_invocation_id) id: vec3<u32>) {
    let slot = id.x;
    var low = 0u;
    var high = plane.alphabet;    // c(low) <= slot < c(high)
    while (high - low > 1u) {
        let middle = (low + high) / 2u;
        if (cumulative[middle] <= slot) {
            low = middle;
        } else {
            high = middle;
        }
    }
    symbol_of_slot[slot] = low;
}

// ---- decode: an invocation for each lane; lane j has the symbols j, j + lane_count, ...

@compute @workgroup_size(MAX_LANES)
fn decode(@builtin(local_invocation_index) lane: u32) {
    var taken = moved_words[0];    // by the rounds before
    clear_ballots(lane);
    var x = 0u;
    if (lane < plane.lane_count) {
        x = states[lane];
    }
    for (var round = 0u; round < plane.rounds; round++) {
        let i = (plane.first_round + round) * plane.lane_count + lane;
        var needs_word = false;
        if (lane < plane.lane_count && i < plane.count) {
            let slot = x & ((1u << plane.entropy_precision) - 1u);
            let s = symbol_of_slot[slot];
            let frequency = cumulative[s + 1u] - cumulative[s];
            x = frequency * (x >> plane.entropy_precision) + slot - cumulative[s];    // (7-1)
            symbols[i] = s;
            needs_word = x < LOWEST_STATE;
        }
        let votes = ballot(round, lane, needs_word);
        if (needs_word) {
            x = (x << 16u) | word(taken + votes_before(votes, lane));
        }
        taken += all_votes(votes);
    }
    if (lane < plane.lane_count) {
        states[lane] = x;
    }
    if (lane == 0u) {
        moved_words[0] = taken;
    }
}

// Word k; 0 if it is missing, which the host finds by the number of words that were needed (R-7-1).
fn word(k: u32) -> u32 {
    if (k >= plane.word_count) {
        return 0u;
    }
    return (words[k / 2u] >> (16u * (k % 2u))) & 0xffffu;
}

// ---- encode: the same backwards. A lane emits at most one word a symbol, since R is at most 16.

@compute @workgroup_size(MAX_LANES)
fn encode(@builtin(local_invocation_index) lane: u32) {
    var given = moved_words[0];
    clear_ballots(lane);
    var x = LOWEST_STATE;
    if (plane.first_round > 0u && lane < plane.lane_count) {
        x = states[lane];
    }
    let all_rounds = (plane.count + plane.lane_count - 1u) / max(plane.lane_count, 1u);
    for (var round = 0u; round < plane.rounds; round++) {
        let i = (all_rounds - 1u - plane.first_round - round) * plane.lane_count + lane;
        let encodes = lane < plane.lane_count && i < plane.count;
        // range: a symbol that is encoded has one
        var frequency = 1u;
        var start = 0u;
        var full = false;
        if (encodes) {
            start = cumulative[symbols[i]];
            frequency = cumulative[symbols[i] + 1u] - start;
            full = x >> (32u - plane.entropy_precision) >= frequency;    // x >= f << (32 - R), which may be 2^32
        }
        let votes = ballot(round, lane, full);
        if (full) {
            let higher_lanes = all_votes(votes) - votes_before(votes, lane) - 1u;    // they come first
            emitted[given + higher_lanes] = x & 0xffffu;
            x >>= 16u;
        }
        if (encodes) {
            x = ((x / frequency) << plane.entropy_precision) + x % frequency + start;    // (7-2)
        }
        given += all_votes(votes);
    }
    if (lane < plane.lane_count) {
        states[lane] = x;
    }
    if (lane == 0u) {
        moved_words[0] = given;
    }
}
