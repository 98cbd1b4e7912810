// The passes of a frame of profile `main` (spec.md, section 15.6): all lanes of a run decode at once, each an invocation,
// and each group of 32 lanes is a workgroup with words of its own. A dispatch has some symbols of a pass that have the
// same kind of distribution, or as many rounds of them as a dispatch may take (main_frames.py).
//
//     pass             bindings              what is decoded
//     read_modeled     0 2 3 4 5 6 7 8 9     symbols by the frequencies of contexts, which are counted
//     read_densities   0 1 2 3 4 5 6 7 9     bins, each by a density of its own
//
// The texts of main_tables.wgsl and main_densities.wgsl stand in front. Symbols of a pass depend on no other one of it,
// so the lanes of a group meet once a round: to find which of them take a word.

struct Pass {
    lane_count: u32,         // range: at least 1
    first_round: u32,        // of this dispatch, each round being a symbol of every lane
    rounds: u32,             // at most
    slot: u32,               // where a run has the number of symbols in front of these,
    first_slot: u32,         // and in front of the pass
    number: u32,             // of the pass
    listed: u32,             // 1: the symbols are those of the items of a list; 0: of `count` items from 0 on
    count: u32,
    chosen_by: u32,          // what distribution an item has: FIRST, BY_CHOICE or BY_ITEM
    first_choice: u32,       // the first distribution of the plane
    symbols: u32,            // of a context
    magnitudes: u32,         // 1: the symbols are classes of magnitudes, whose low bits follow
}

const FIRST = 0u;
const BY_CHOICE = 1u;

const GROUP = 32u;           // lanes
const LOWEST_STATE = 0x10000u;

// Where a run has, after the states of its lanes: the next word of each group, the one after its last, how many symbols
// stand in front of each dispatch, and of all symbols c(s), f(s), pass and lane, 16 bits each.
const TAKEN = 4096u;
const ENDS = 4224u;
const SLOTS = 4352u;
const SYMBOLS = 4608u;

@group(0) @binding(0) var<uniform> pass_: Pass;
@group(0) @binding(2) var<storage, read_write> run: array<u32>;
@group(0) @binding(3) var<storage, read> words: array<u32>;                  // two words of 16 bits in each
@group(0) @binding(4) var<storage, read> list: array<u32>;                   // how many items, and which
@group(0) @binding(5) var<storage, read> choices: array<u32>;                // of items
@group(0) @binding(6) var<storage, read> cumulative: array<u32>;             // (contexts, symbols + 1)
@group(0) @binding(6) var<storage, read> densities: array<Density>;
@group(0) @binding(7) var<storage, read_write> values: array<u32>;           // of items
@group(0) @binding(8) var<storage, read_write> seen: array<atomic<u32>>;     // (contexts, symbols)
@group(0) @binding(9) var<storage, read_write> low_bits: array<u32>;         // of items: how many raw bits follow

// Which lanes of the group take a word in a round. Three ballots in turn make one barrier a round enough: while one is
// voted on, a slow lane may still read the one before, and the third is cleared. (With the feature "subgroups" and the
// group in one subgroup, subgroupBallot does this without workgroup memory.)
var<workgroup> ballots: array<atomic<u32>, 3>;

// What a lane knows of a dispatch.
struct Lane {
    number: u32,
    of_group: u32,           // its number in the group. range: below 32
    group: u32,
    in_front: u32,           // symbols of the frame in front of these,
    of_pass: u32,            // and of the pass
    count: u32,              // symbols
    first_round: u32,
    rounds: u32,
    x: u32,
    taken: u32,
}

fn enter(of_group: u32, group: u32) -> Lane {
    // WebGPU promises zeros, but not every implementation keeps that: wgpu-py 0.32 on Mesa's lavapipe did not.
    if (of_group < 3u) {
        atomicStore(&ballots[of_group], 0u);
    }
    var lane: Lane;
    lane.number = GROUP * group + of_group;
    lane.of_group = of_group;
    lane.group = group;
    lane.in_front = run[SLOTS + pass_.slot];
    lane.of_pass = lane.in_front - run[SLOTS + pass_.first_slot];
    lane.count = select(pass_.count, list[0], pass_.listed == 1u);
    lane.first_round = lane.of_pass / pass_.lane_count + pass_.first_round;
    let end = (lane.of_pass + lane.count + pass_.lane_count - 1u) / pass_.lane_count;
    lane.rounds = min(max(end, lane.first_round) - lane.first_round, pass_.rounds);
    lane.x = run[lane.number];
    lane.taken = run[TAKEN + group];
    workgroupBarrier();
    return lane;
}

// The symbol that a lane decodes in a round, counted from those in front; the dispatch has it if it is below `count`.
fn symbol_at(lane: Lane, round: u32) -> u32 {
    let place = (lane.first_round + round) * pass_.lane_count + lane.number;
    return select(place - lane.of_pass, 0xffffffffu, place < lane.of_pass || lane.number >= pass_.lane_count);
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

// (7-1) but for the word that may follow; notes the symbol.
fn without_word(lane: Lane, i: u32, symbol: Symbol) -> u32 {
    let at = SYMBOLS + 2u * (lane.in_front + i);
    run[at] = symbol.start | (symbol.frequency << 16u);
    run[at + 1u] = pass_.number | (lane.number << 16u);
    return symbol.frequency * (lane.x >> 14u) + (lane.x & 0x3fffu) - symbol.start;
}

// The state and the words that were taken after a round. All lanes have to come here, in every round. A word that is
// missing is 0; the host finds it by the number of words that were needed (R-7-1).
fn with_word(lane: Lane, round: u32, needs_word: bool) -> vec2<u32> {
    if (needs_word) {
        atomicOr(&ballots[round % 3u], 1u << lane.of_group);
    }
    workgroupBarrier();
    let votes = atomicLoad(&ballots[round % 3u]);
    if (lane.of_group == 0u) {
        atomicStore(&ballots[(round + 2u) % 3u], 0u);
    }
    var x = lane.x;
    if (needs_word) {
        let k = lane.taken + countOneBits(votes & ((1u << lane.of_group) - 1u));
        x <<= 16u;
        if (k < run[ENDS + lane.group]) {
            x |= (words[k / 2u] >> (16u * (k % 2u))) & 0xffffu;
        }
    }
    return vec2<u32>(x, lane.taken + countOneBits(votes));
}

fn leave(lane: Lane) {
    run[lane.number] = lane.x;
    if (lane.of_group == 0u) {
        run[TAKEN + lane.group] = lane.taken;
    }
    if (lane.number == 0u) {
        run[SLOTS + pass_.slot + 1u] = lane.in_front + lane.count;
    }
}

@compute @workgroup_size(GROUP)
fn read_modeled(@builtin(local_invocation_index) of_group: u32, @builtin(workgroup_id) id: vec3<u32>) {
    var lane = enter(of_group, id.x);
    for (var round = 0u; round < lane.rounds; round++) {
        let i = symbol_at(lane, round);
        var needs_word = false;
        if (i < lane.count) {
            let item = item_of(i);
            let context = choice_of(item);
            let symbol = symbol_of_context(context, lane.x & 0x3fffu);
            values[item] = symbol.value;
            if (pass_.magnitudes == 1u) {
                low_bits[item] = bits_of_class(symbol.value);
            }
            atomicAdd(&seen[context * pass_.symbols + symbol.value], 1u);
            lane.x = without_word(lane, i, symbol);
            needs_word = lane.x < LOWEST_STATE;
        }
        let behind = with_word(lane, round, needs_word);
        lane.x = behind.x;
        lane.taken = behind.y;
    }
    leave(lane);
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

@compute @workgroup_size(GROUP)
fn read_densities(@builtin(local_invocation_index) of_group: u32, @builtin(workgroup_id) id: vec3<u32>) {
    var lane = enter(of_group, id.x);
    for (var round = 0u; round < lane.rounds; round++) {
        let i = symbol_at(lane, round);
        var needs_word = false;
        if (i < lane.count) {
            let item = item_of(i);
            let density = densities[choice_of(item)];
            let symbol = symbol_of_density(density, lane.x & 0x3fffu);
            values[item] = symbol.value;
            low_bits[item] = select(density.low_bits, bits_of_class(symbol.value), pass_.magnitudes == 1u);
            lane.x = without_word(lane, i, symbol);
            needs_word = lane.x < LOWEST_STATE;
        }
        let behind = with_word(lane, round, needs_word);
        lane.x = behind.x;
        lane.taken = behind.y;
    }
    leave(lane);
}
