// The passes of a frame of profile `main` (spec.md, section 15.6): all lanes of a run decode at once, each an invocation
// of one workgroup. A dispatch is a pass, or as many of its rounds as a dispatch may take (main_frames.py).
//
//     pass             bindings              what is decoded
//     read_modeled     0 2 3 4 5 6 7 8 9     symbols by the frequencies of contexts, which are counted
//     read_densities   0 1 2 3 4 5 6 7 9     bins, each by a density of its own
//     read_bits        0 2 3 4 6 7           raw bits, of sizes that differ
//
// The texts of ballots.wgsl, main_tables.wgsl and main_densities.wgsl stand in front. Symbols of a pass depend on no
// other one of it, so the lanes meet once a round: to find which of them take a word.

struct Pass {
    lane_count: u32,
    word_count: u32,
    first_round: u32,        // of this dispatch, each round being a symbol of every lane
    rounds: u32,             // at most
    listed: u32,             // 1: the pass has the items of a list; 0: `count` items from 0 on
    count: u32,
    chosen_by: u32,          // what distribution an item has: FIRST, BY_CHOICE or BY_ITEM
    first_choice: u32,       // the first distribution of the plane
    symbols: u32,            // of a context
    magnitudes: u32,         // 1: the symbols are classes of magnitudes, whose low bits follow
    kind: u32,               // of raw bits: UPPER, LOWER or SIGNS
    offset: u32,             // of the values
    stride: u32,
}

const FIRST = 0u;
const BY_CHOICE = 1u;

const UPPER = 0u;            // all but the lowest 14
const LOWER = 1u;
const SIGNS = 2u;            // one bit each

const TAKEN = 64u;           // where a run has the number of its words that were taken

@group(0) @binding(0) var<uniform> pass_: Pass;
@group(0) @binding(2) var<storage, read_write> run: array<u32>;              // the states of 64 lanes, and TAKEN
@group(0) @binding(3) var<storage, read> words: array<u32>;                  // two words of 16 bits in each
@group(0) @binding(4) var<storage, read> list: array<u32>;                   // how many items, and which
@group(0) @binding(5) var<storage, read> choices: array<u32>;                // of items
@group(0) @binding(6) var<storage, read> cumulative: array<u32>;             // (contexts, symbols + 1)
@group(0) @binding(6) var<storage, read> densities: array<Density>;
@group(0) @binding(6) var<storage, read> bit_counts: array<u32>;             // of items
@group(0) @binding(7) var<storage, read_write> values: array<u32>;           // of items
@group(0) @binding(8) var<storage, read_write> seen: array<atomic<u32>>;     // (contexts, symbols)
@group(0) @binding(9) var<storage, read_write> low_bits: array<u32>;         // of items: how many raw bits follow

fn symbol_count() -> u32 {
    return select(pass_.count, list[0], pass_.listed == 1u);
}

fn rounds_of(symbols: u32) -> u32 {
    let rounds = (symbols + pass_.lane_count - 1u) / pass_.lane_count;
    return min(rounds - min(pass_.first_round, rounds), pass_.rounds);
}

fn item_of(i: u32) -> u32 {
    if (pass_.listed == 1u) {
        return list[1u + i];
    }
    return i;
}

fn choice_of(item: u32) -> u32 {
    switch (pass_.chosen_by) {
        case FIRST: { return pass_.first_choice; }
        case BY_CHOICE: { return pass_.first_choice + choices[item]; }
        default: { return pass_.first_choice + item; }
    }
}

// How many low bits a class of magnitudes has.
fn bits_of_class(q: u32) -> u32 {
    return select(q / 2u - 1u, 0u, q < 4u);
}

// (7-1) but for the word that may follow.
fn without_word(x: u32, symbol: Symbol) -> u32 {
    return symbol.frequency * (x >> 14u) + (x & 0x3fffu) - symbol.start;
}

// Word k; 0 if it is missing, which the host finds by the number of words that were needed (R-7-1).
fn word(k: u32) -> u32 {
    if (k >= pass_.word_count) {
        return 0u;
    }
    return (words[k / 2u] >> (16u * (k % 2u))) & 0xffffu;
}

@compute @workgroup_size(MAX_LANES)
fn read_modeled(@builtin(local_invocation_index) lane: u32) {
    var taken = run[TAKEN];
    var x = run[lane];
    clear_ballots(lane);
    let count = symbol_count();
    let rounds = rounds_of(count);
    for (var round = 0u; round < rounds; round++) {
        let i = (pass_.first_round + round) * pass_.lane_count + lane;
        var needs_word = false;
        if (lane < pass_.lane_count && i < count) {
            let item = item_of(i);
            let context = choice_of(item);
            let symbol = symbol_of_context(context, x & 0x3fffu);
            values[pass_.offset + item * pass_.stride] = symbol.value;
            if (pass_.magnitudes == 1u) {
                low_bits[item] = bits_of_class(symbol.value);
            }
            atomicAdd(&seen[context * pass_.symbols + symbol.value], 1u);
            x = without_word(x, symbol);
            needs_word = x < LOWEST_STATE;
        }
        let votes = ballot(round, lane, needs_word);
        if (needs_word) {
            x = (x << 16u) | word(taken + votes_before(votes, lane));
        }
        taken += all_votes(votes);
    }
    leave(lane, x, taken);
}

fn symbol_of_context(context: u32, slot: u32) -> Symbol {
    let first = context * (pass_.symbols + 1u);
    var low = 0u;
    var high = pass_.symbols;    // C[low] <= slot < C[high]
    while (high - low > 1u) {
        let middle = (low + high) / 2u;
        if (cumulative[first + middle] <= slot) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return Symbol(low, cumulative[first + low], cumulative[first + low + 1u] - cumulative[first + low]);
}

@compute @workgroup_size(MAX_LANES)
fn read_densities(@builtin(local_invocation_index) lane: u32) {
    var taken = run[TAKEN];
    var x = run[lane];
    clear_ballots(lane);
    let count = symbol_count();
    let rounds = rounds_of(count);
    for (var round = 0u; round < rounds; round++) {
        let i = (pass_.first_round + round) * pass_.lane_count + lane;
        var needs_word = false;
        if (lane < pass_.lane_count && i < count) {
            let item = item_of(i);
            let density = densities[choice_of(item)];
            let symbol = symbol_of_density(density, x & 0x3fffu);
            values[pass_.offset + item * pass_.stride] = symbol.value;
            low_bits[item] = select(density.low_bits, bits_of_class(symbol.value), pass_.magnitudes == 1u);
            x = without_word(x, symbol);
            needs_word = x < LOWEST_STATE;
        }
        let votes = ballot(round, lane, needs_word);
        if (needs_word) {
            x = (x << 16u) | word(taken + votes_before(votes, lane));
        }
        taken += all_votes(votes);
    }
    leave(lane, x, taken);
}

// Raw bits go behind those that the value has: the upper ones first, then the lower ones.
@compute @workgroup_size(MAX_LANES)
fn read_bits(@builtin(local_invocation_index) lane: u32) {
    var taken = run[TAKEN];
    var x = run[lane];
    clear_ballots(lane);
    let count = symbol_count();
    let rounds = rounds_of(count);
    for (var round = 0u; round < rounds; round++) {
        let i = (pass_.first_round + round) * pass_.lane_count + lane;
        var needs_word = false;
        if (lane < pass_.lane_count && i < count) {
            let item = item_of(i);
            let bits = raw_bits(item);
            let value = (x & 0x3fffu) >> (14u - bits);
            let at = pass_.offset + item * pass_.stride;
            values[at] = (values[at] << bits) | value;
            x = without_word(x, Symbol(value, value << (14u - bits), TOTAL >> bits));
            needs_word = x < LOWEST_STATE;
        }
        let votes = ballot(round, lane, needs_word);
        if (needs_word) {
            x = (x << 16u) | word(taken + votes_before(votes, lane));
        }
        taken += all_votes(votes);
    }
    leave(lane, x, taken);
}

fn raw_bits(item: u32) -> u32 {
    switch (pass_.kind) {
        case UPPER: { return bit_counts[item] - 14u; }
        case LOWER: { return min(bit_counts[item], 14u); }
        default: { return 1u; }
    }
}

fn leave(lane: u32, x: u32, taken: u32) {
    run[lane] = x;
    if (lane == 0u) {
        run[TAKEN] = taken;
    }
}
