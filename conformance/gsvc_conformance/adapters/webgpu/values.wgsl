// What is done to each number of an array, exact on every machine: arithmetic is that of binary32.wgsl, which stands
// in front.
//
//     pass           dispatch      bindings     what
//     from_halves    count / 256   0 1 3        (8-5)
//     to_halves      count / 256   0 1 3        (8-6)
//     dequantize     count / 256   0 1 2 3      fl(fl(q s) + beta) of section 10.5
//     scale          count / 256   0 1 3        (9-8)
//     filtered       count / 256   0 1 3        (9-9), in f32: the first count / 8 invocations take a splat each

struct Shape {
    count: u32,          // numbers
    columns: u32,        // of them beside each other. range: at least 1
    size: vec2<u32>,     // scale: width and height that are scaled
    new_size: vec2<u32>,
}

@group(0) @binding(0) var<uniform> shape: Shape;
@group(0) @binding(1) var<storage, read> values: array<u32>;               // bit patterns, or codes
@group(0) @binding(2) var<storage, read> quantizers: array<vec2<u32>>;     // scale and offset of each column, binary32
@group(0) @binding(3) var<storage, read_write> result: array<u32>;

@compute @workgroup_size(256)
fn from_halves(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < shape.count) {
        result[id.x] = from_half(values[id.x]);
    }
}

@compute @workgroup_size(256)
fn to_halves(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < shape.count) {
        result[id.x] = to_half(values[id.x]);
    }
}

@compute @workgroup_size(256)
fn dequantize(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < shape.count) {
        let quantizer = quantizers[id.x % shape.columns];
        result[id.x] = add(multiply(from_integer(values[id.x]), quantizer.x), quantizer.y);
    }
}

// (9-8) of a number
fn scaled(at: u32) -> u32 {
    let column = at % 8u;    // x, y, l11, l21, l22, R, G, B
    var factor = ONE;
    if (column == 0u || column == 2u) {
        factor = divide(from_integer(shape.new_size.x), from_integer(shape.size.x));    // a
    } else if (column < 5u) {
        factor = divide(from_integer(shape.new_size.y), from_integer(shape.size.y));    // e
    }
    return multiply(values[at], factor);
}

@compute @workgroup_size(256)
fn scale(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < shape.count) {
        result[id.x] = scaled(id.x);
    }
}

// A root to the 2.5 units of (13-3): that of WGSL may be worse, and one step of Newton's method makes it good.
fn root(square: f32) -> f32 {
    let r = sqrt(square);    // range: 2^-10 or more
    return r + (square - r * r) / (2.0 * r);
}

// The root of p^2 + q^2, whose squares may leave the range of f32.
// range: p is 2^-126 or more, both are finite
fn hypotenuse(p: f32, q: f32) -> f32 {
    let larger = max(p, abs(q));    // range: of p
    let ratio = min(p, abs(q)) / larger;
    return larger * root(1.0 + ratio * ratio);
}

// The root of v of (9-9) for a side that becomes smaller.
// range: old is 1 to 65535
fn deviation(old: u32, new_side: u32) -> f32 {
    return root(f32(old - new_side) * f32(old + new_side) / (f32(12u * old) * f32(old)));
}

@compute @workgroup_size(256)
fn filtered(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= shape.count / 8u) {
        return;
    }
    let at = 8u * id.x;
    for (var column = 0u; column < 8u; column++) {
        result[at + column] = scaled(at + column);
    }
    if (values[at + 2u] - 0x00800000u >= 0x7f000000u || values[at + 4u] - 0x00800000u >= 0x7f000000u) {
        return;    // degenerate: R-9.4-3
    }
    let l11 = bitcast<f32>(result[at + 2u]);
    let l21 = bitcast<f32>(result[at + 3u]);
    let l22 = bitcast<f32>(result[at + 4u]);
    var m11 = l11;    // range: of l11, or above
    var m22 = l22;    // range: of l22, or above
    if (shape.new_size.y < shape.size.y) {
        m22 = hypotenuse(m22, deviation(shape.size.y, shape.new_size.y));
    }
    if (shape.new_size.x < shape.size.x) {
        let h = deviation(shape.size.x, shape.new_size.x);
        m11 = hypotenuse(m11, h);
        m22 = hypotenuse(m22, l21 * (h / m11));
        result[at + 3u] = bitcast<u32>(l21 * (l11 / m11));
    }
    result[at + 2u] = bitcast<u32>(m11);
    result[at + 4u] = bitcast<u32>(m22);
    let weight = (l11 / m11) * (l22 / m22);
    for (var column = 5u; column < 8u; column++) {
        result[at + column] = bitcast<u32>(bitcast<f32>(values[at + column]) * weight);
    }
}
