// What is done to each number of an array, exact on every machine: arithmetic is that of binary32.wgsl, which stands
// in front.
//
//     pass           dispatch      bindings     what
//     from_halves    count / 256   0 1 3        (8-5)
//     to_halves      count / 256   0 1 3        (8-6)
//     dequantize     count / 256   0 1 2 3      fl(fl(q s) + beta) of section 10.5
//     scale          count / 256   0 1 3        (9-8)

struct Shape {
    count: u32,          // numbers
    columns: u32,        // of them beside each other
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

@compute @workgroup_size(256)
fn scale(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x < shape.count) {
        let column = id.x % 8u;    // x, y, l11, l21, l22, R, G, B
        var factor = ONE;
        if (column == 0u || column == 2u) {
            factor = divide(from_integer(shape.new_size.x), from_integer(shape.size.x));    // a
        } else if (column < 5u) {
            factor = divide(from_integer(shape.new_size.y), from_integer(shape.size.y));    // e
        }
        result[id.x] = multiply(values[id.x], factor);
    }
}
