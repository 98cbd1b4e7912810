// Reconstruction (spec.md, section 8), exact on every machine: arithmetic is that of binary32.wgsl, which stands in
// front.
//
//     pass     dispatch      bindings
//     intra    count / 256   0 1 2 3 4 7
//     inter    count / 256   0 1 2 3 4 5 6 7
//
// One invocation a splat. All floats are bit patterns.

struct Block {
    half_size: vec2<u32>,                      // W/2, H/2, as binary32
    count: u32,                                // splats of the block
    stage_count: u32,                          // M
    positions_present: u32,                    // 0 or 1, as all of an inter block's attributes
    cholesky_present: u32,
    colors_present: u32,
    scale: vec4<u32>,                          // s and beta of l11, l21, l22, as binary32
    offset: vec4<u32>,
    first_of_stage: array<vec4<u32>, 2>,       // the first codeword of each stage, of 8 at most
}

@group(0) @binding(0) var<uniform> block: Block;
@group(0) @binding(1) var<storage, read> positions: array<u32>;       // binary16 of x, and above it that of y
@group(0) @binding(2) var<storage, read> cholesky: array<u32>;        // (N, 3)
@group(0) @binding(3) var<storage, read> color_indices: array<u32>;   // (N, M)
@group(0) @binding(4) var<storage, read> codewords: array<u32>;       // binary16, (B, 3)
@group(0) @binding(5) var<storage, read> reference: array<u32>;       // the frame before, binary32, (N, 8)
@group(0) @binding(6) var<storage, read> survivors: array<u32>;       // of a splat, its number in the frame before
@group(0) @binding(7) var<storage, read_write> result: array<u32>;    // binary32, (N, 8)

// (8-3) of channel k: a rounded product, then a rounded sum.
fn dequantized(code: u32, k: u32) -> u32 {
    return add(multiply(from_integer(code), block.scale[k]), block.offset[k]);
}

// (8-4) of channel k: the codewords in the order of the stages.
fn codeword_sum(n: u32, channel: u32) -> u32 {
    var sum = 0u;
    for (var stage = 0u; stage < block.stage_count; stage++) {
        let codeword = block.first_of_stage[stage / 4u][stage % 4u] + color_indices[n * block.stage_count + stage];
        let value = from_half(codewords[3u * codeword + channel]);
        if (stage == 0u) {
            sum = value;                       // not 0 + value, which makes +0 of -0
        } else {
            sum = add(sum, value);
        }
    }
    return sum;
}

// range: axis is 0 or 1
fn position_code(n: u32, axis: u32) -> u32 {
    return from_half((positions[n] >> (16u * axis)) & 0xffffu);
}

@compute @workgroup_size(256)
fn intra(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = id.x;
    if (n >= block.count) {
        return;
    }
    for (var axis = 0u; axis < 2u; axis++) {
        result[8u * n + axis] = multiply(add(position_code(n, axis), ONE), block.half_size[axis]);    // (8-1), (8-2)
    }
    for (var k = 0u; k < 3u; k++) {
        result[8u * n + 2u + k] = dequantized(cholesky[3u * n + k], k);
        result[8u * n + 5u + k] = codeword_sum(n, k);
    }
}

@compute @workgroup_size(256)
fn inter(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = id.x;
    if (n >= block.count) {
        return;
    }
    for (var k = 0u; k < 8u; k++) {
        result[8u * n + k] = reference[8u * survivors[n] + k];
    }
    if (block.positions_present == 1u) {
        for (var axis = 0u; axis < 2u; axis++) {
            let difference = multiply(position_code(n, axis), block.half_size[axis]);
            result[8u * n + axis] = add(result[8u * n + axis], difference);
        }
    }
    if (block.cholesky_present == 1u) {
        for (var k = 0u; k < 3u; k++) {
            result[8u * n + 2u + k] = add(result[8u * n + 2u + k], dequantized(cholesky[3u * n + k], k));
        }
    }
    if (block.colors_present == 1u) {
        for (var k = 0u; k < 3u; k++) {
            result[8u * n + 5u + k] = add(result[8u * n + 5u + k], codeword_sum(n, k));
        }
    }
}
