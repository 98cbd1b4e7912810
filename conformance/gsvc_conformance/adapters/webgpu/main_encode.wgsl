// The words of a run of profile `main` (spec.md, R-15.6-3): each lane an invocation, which goes through the symbols
// backwards and takes those of its own. So no lane waits for another one; the host puts the words of groups together.
//
//     pass     bindings           what
//     encode   0 1 2 3 4 5        (7-2)

struct Run {
    count: u32,        // symbols
    last: u32,         // the first one to be encoded
    rounds: u32,       // symbols of this dispatch
    lane_count: u32,
}

@group(0) @binding(0) var<uniform> run: Run;
@group(0) @binding(1) var<storage, read> starts: array<u32>;            // c(s) of each symbol
@group(0) @binding(2) var<storage, read> frequencies: array<u32>;
@group(0) @binding(3) var<storage, read> lanes: array<u32>;
@group(0) @binding(4) var<storage, read_write> states: array<u32>;      // of the lanes
@group(0) @binding(5) var<storage, read_write> emitted: array<u32>;     // 2^16 and the word that a symbol emits, or 0

@compute @workgroup_size(64)
fn encode(@builtin(global_invocation_id) id: vec3<u32>) {
    let lane = id.x;
    if (lane >= run.lane_count) {
        return;
    }
    var x = states[lane];
    for (var k = 0u; k < run.rounds; k++) {
        let i = run.last - k;
        if (lanes[i] != lane) {
            continue;
        }
        // range: a symbol that is encoded has one
        let f = frequencies[i];
        if (x >> 18u >= f) {                // x >= f << 18, which may be 2^32; once is enough: then x is below 2^16
            emitted[i] = 0x10000u | (x & 0xffffu);
            x >>= 16u;
        }
        x = ((x / f) << 14u) + x % f + starts[i];
    }
    states[lane] = x;
}
