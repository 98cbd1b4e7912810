// Lists of profile `main` (spec.md, section 15.6): which items a pass has, in their order. One workgroup each.
//
//     pass      bindings    what
//     choose    0 1 2       the items whose number fulfils a condition, and how many they are
//     starts    0 1 2 3     the sums of the numbers of the items before, for the items of a list
//     words     0 1 2 3     the words of the items of a list, two in each number

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
        var before = taken;
        for (var part = 0u; part < 8u; part++) {
            let bits = atomicLoad(&chosen[part]);
            let lower_lanes = select(0u, (1u << (lane % 32u)) - 1u, part == lane / 32u);
            before += countOneBits(bits & select(lower_lanes, 0xffffffffu, part < lane / 32u));
            taken += countOneBits(bits);
        }
        if (takes) {
            list[1u + before] = i;
        }
        workgroupBarrier();
    }
    if (lane == 0u) {
        list[0] = taken;
    }
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
        for (var distance = 1u; distance < LANES; distance *= 2u) {
            var more = 0u;
            if (lane >= distance) {
                more = sums[lane - distance];
            }
            workgroupBarrier();
            sums[lane] += more;
            workgroupBarrier();
        }
        if (i < found[0]) {
            result[i] = sum + sums[lane] - own;
        }
        sum += sums[LANES - 1u];
        workgroupBarrier();
    }
}

@compute @workgroup_size(LANES)
fn words(@builtin(global_invocation_id) id: vec3<u32>) {
    if (2u * id.x >= found[0]) {
        return;
    }
    var second = 0u;
    if (2u * id.x + 1u < found[0]) {
        second = numbers[found[2u + 2u * id.x]] & 0xffffu;
    }
    result[id.x] = (numbers[found[1u + 2u * id.x]] & 0xffffu) | (second << 16u);
}
