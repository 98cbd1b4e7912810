// Raw values of a frame of profile `main` (spec.md, section 15.6): where each stands in its string, a prefix sum of sizes,
// and what it is, one load.
//
//     pass       dispatch       bindings            what
//     offsets    1              0 1 2 3             where the values of items begin
//     take       items / 256    0 1 2 3 4 5 6       the values

struct Values {
    count: u32,        // items
    signs: u32,        // 1: a value has a bit where the number is not 0; 0: so many bits as the number says
    late: u32,         // 1: of the late string, 0: of the early one
    lane_count: u32,
    offset: u32,       // of the result
    stride: u32,
}

@group(0) @binding(0) var<uniform> told: Values;
@group(0) @binding(1) var<storage, read> numbers: array<u32>;              // of items
@group(0) @binding(2) var<storage, read_write> places: array<u32>;         // of items, in their string
@group(0) @binding(3) var<storage, read_write> lengths: array<u32>;        // of the early string so far, and the late one
@group(0) @binding(4) var<storage, read> text: array<u32>;                 // the string in the payload, after its length
@group(0) @binding(5) var<storage, read> states: array<u32>;               // of the lanes
@group(0) @binding(6) var<storage, read_write> result: array<u32>;

const LANES = 256u;

var<workgroup> sums: array<u32, 256>;

fn size_of(item: u32) -> u32 {
    if (item >= told.count) {
        return 0u;
    }
    return select(numbers[item], min(numbers[item], 1u), told.signs == 1u);
}

// A step of the prefix sum; all lanes have to come here.
fn add_from(lane: u32, distance: u32) {
    var more = 0u;
    if (lane >= distance) {
        more = sums[lane - distance];
    }
    workgroupBarrier();
    sums[lane] += more;
    workgroupBarrier();
}

@compute @workgroup_size(LANES)
fn offsets(@builtin(local_invocation_index) lane: u32) {
    var sum = lengths[told.late];
    for (var first = 0u; first < told.count; first += LANES) {
        let own = size_of(first + lane);
        sums[lane] = own;
        workgroupBarrier();
        add_from(lane, 1u);
        add_from(lane, 2u);
        add_from(lane, 4u);
        add_from(lane, 8u);
        add_from(lane, 16u);
        add_from(lane, 32u);
        add_from(lane, 64u);
        add_from(lane, 128u);
        if (first + lane < told.count) {
            places[first + lane] = sum + sums[lane] - own;
        }
        sum += sums[LANES - 1u];
        workgroupBarrier();
    }
    if (lane == 0u) {
        lengths[told.late] = sum;
    }
}

// 32 bits of the payload's string; 0 after its end.
fn word_of_text(number: u32) -> u32 {
    if (number >= text[0]) {
        return 0u;
    }
    return text[1u + number];
}

// range: size is at most 23, what a number of one element has (section 15.6)
fn bits_of_text(at: u32, size: u32) -> u32 {
    // range: 1 to 31 where it is shifted to the left
    let shift = at % 32u;
    var bits = word_of_text(at / 32u) >> shift;
    if (shift > 0u) {
        bits |= word_of_text(at / 32u + 1u) << (32u - shift);
    }
    return bits & ((1u << size) - 1u);
}

// Of the halves that the lanes end with.
// range: size is at most 16
fn carried(at: u32, size: u32) -> u32 {
    let pair = (states[at / 16u] & 0xffffu) | (states[at / 16u + 1u] << 16u);
    return (pair >> (at % 16u)) & ((1u << size) - 1u);
}

@compute @workgroup_size(LANES)
fn take(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = size_of(id.x);
    if (size == 0u) {
        return;
    }
    var at = places[id.x];
    var value = 0u;
    if (told.late == 0u) {
        value = bits_of_text(at, size);
    } else {
        let half_bits = min(16u * told.lane_count, lengths[1] / 16u * 16u);
        // range: at most the size
        let of_lanes = min(size, max(half_bits, at) - at);    // the rest of its bits follow the early ones
        at = lengths[0] + max(at, half_bits) - half_bits;
        if (of_lanes > 0u) {
            value = carried(places[id.x], of_lanes);
        }
        if (of_lanes < size) {
            value |= bits_of_text(at, size - of_lanes) << of_lanes;
        }
    }
    result[told.offset + id.x * told.stride] = value;
}
