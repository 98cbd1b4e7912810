// Lists of profile `main` (spec.md, section 15.6): which items a pass has, in their order. The first two are one
// workgroup each, without loops in their loop: Mesa's software rasteriser leaves the loops of an invocation after 65,535
// rounds of all of them together.
//
//     pass      bindings    what
//     choose    0 1 2       the items whose number fulfils a condition, and how many they are
//     starts    0 1 2 3     the sums of the numbers of the items before, for the items of a list

struct Condition {
    count: u32,        // items that are looked at, the first one included
    offset: u32,       // of their numbers
    stride: u32,
    flipped: u32,      // an item is taken if ((number ^ flipped) & mask) > threshold
    mask: u32,
    threshold: u32,
}

@group(0) @binding(0) var<uniform> condition: Condition;
@group(0) @binding(1) var<storage, read> numbers: array<u32>;
@group(0) @binding(2) var<storage, read_write> list: array<u32>;      // how many, and which
@group(0) @binding(2) var<storage, read> found: array<u32>;
@group(0) @binding(3) var<storage, read_write> result: array<u32>;

const LANES = 256u;

var<workgroup> chosen: array<atomic<u32>, 8>;
var<workgroup> sums: array<u32, 256>;

// 32 lanes, a bit each.
fn part(number: u32) -> u32 {
    return atomicLoad(&chosen[number]);
}

fn ones(bits: vec4<u32>) -> u32 {
    let each = countOneBits(bits);
    return each.x + each.y + each.z + each.w;
}

// The bits of the lanes before a lane, in parts of these numbers.
fn below(lane: u32, parts: vec4<u32>) -> vec4<u32> {
    let own = vec4<u32>((1u << (lane % 32u)) - 1u);
    let whole = parts < vec4<u32>(lane / 32u);
    return select(select(vec4<u32>(0u), own, parts == vec4<u32>(lane / 32u)), vec4<u32>(0xffffffffu), whole);
}

@compute @workgroup_size(LANES)
fn choose(@builtin(local_invocation_index) lane: u32) {
    var taken = 0u;
    for (var first = 0u; first < condition.count; first += LANES) {
        if (lane < 8u) {
            atomicStore(&chosen[lane], 0u);
        }
        workgroupBarrier();
        let i = first + lane;
        var takes = false;
        if (i < condition.count) {
            let number = numbers[condition.offset + i * condition.stride];
            takes = ((number ^ condition.flipped) & condition.mask) > condition.threshold;
        }
        if (takes) {
            atomicOr(&chosen[lane / 32u], 1u << (lane % 32u));
        }
        workgroupBarrier();
        let low = vec4<u32>(part(0u), part(1u), part(2u), part(3u));
        let high = vec4<u32>(part(4u), part(5u), part(6u), part(7u));
        if (takes) {
            let before = ones(low & below(lane, vec4<u32>(0u, 1u, 2u, 3u)))
                + ones(high & below(lane, vec4<u32>(4u, 5u, 6u, 7u)));
            list[1u + taken + before] = i;
        }
        taken += ones(low) + ones(high);
        workgroupBarrier();
    }
    if (lane == 0u) {
        list[0] = taken;
    }
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
fn starts(@builtin(local_invocation_index) lane: u32) {
    var sum = 0u;
    for (var first = 0u; first < found[0]; first += LANES) {
        let i = first + lane;
        var own = 0u;
        if (i < found[0]) {
            own = numbers[condition.offset + found[1u + i] * condition.stride];
        }
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
        if (i < found[0]) {
            result[i] = sum + sums[lane] - own;
        }
        sum += sums[LANES - 1u];
        workgroupBarrier();
    }
}
