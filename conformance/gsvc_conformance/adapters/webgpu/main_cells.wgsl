// The cells of new splats (spec.md, section 15.8): parts of the frame are halved, each an invocation.
//
//     pass     dispatch          bindings          what
//     ask      parts / 256       0 2 3 4 5         the density of each part that is asked
//     halve    parts / 256       0 2 3 4 6 7 8     both halves of each part, from what was decoded
//     locate   splats / 256      0 2 3 5 6         the cell of each splat
//
// The texts of main_tables.wgsl and main_densities.wgsl stand in front. The host does not know how many parts there
// are: it asks for as many invocations as there can be, and the list of parts says how many there are. A part that
// is not there has no splats.

struct Halving {
    most: u32,         // parts, at most; or splats
    axis: u32,         // 0: left and right, 1: upper and lower
    size: i32,         // cells of a first half along the axis
    inside: i32,       // cells of the frame along it
    halving_code: u32,
}

struct Part {
    column: i32,       // of its first cell
    row: i32,
    splats: u32,
}

@group(0) @binding(0) var<uniform> halving: Halving;
@group(0) @binding(2) var<storage, read> parts: array<Part>;
@group(0) @binding(3) var<storage, read> list: array<u32>;                    // how many parts there are, and which
@group(0) @binding(4) var<storage, read_write> densities: array<Density>;
@group(0) @binding(4) var<storage, read> asked_densities: array<Density>;
@group(0) @binding(5) var<storage, read_write> asked: array<u32>;             // 1: the part is asked
@group(0) @binding(5) var<storage, read> first_splats: array<u32>;            // of each part of the list
@group(0) @binding(6) var<storage, read> bins: array<u32>;
@group(0) @binding(6) var<storage, read_write> cells: array<i32>;             // (splats, 2)
@group(0) @binding(7) var<storage, read> low: array<u32>;                     // the raw bits after the bins
@group(0) @binding(8) var<storage, read_write> halves: array<Part>;

// The cells of the second half that are inside of the frame.
fn second_half(part: Part) -> i32 {
    return min(halving.size, halving.inside - select(part.column, part.row, halving.axis == 1u) - halving.size);
}

@compute @workgroup_size(256)
fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= halving.most) {
        return;
    }
    var is_asked = false;
    if (id.x < list[0]) {
        let part = parts[list[1u + id.x]];
        let second = second_half(part);
        is_asked = second > 0;
        if (is_asked) {
            densities[id.x] = half_density(part.splats, u32(halving.size), u32(second), halving.halving_code);
        }
    }
    asked[id.x] = u32(is_asked);
}

@compute @workgroup_size(256)
fn halve(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= halving.most) {
        return;
    }
    var part = Part(0, 0, 0u);
    var k = 0u;
    if (id.x < list[0]) {
        part = parts[list[1u + id.x]];
        k = part.splats;
        if (second_half(part) > 0) {
            k = min((bins[id.x] << asked_densities[id.x].low_bits) + low[id.x], k);
        }
    }
    var other = part;
    part.splats = k;
    other.splats -= k;
    other.column += select(halving.size, 0, halving.axis == 1u);
    other.row += select(0, halving.size, halving.axis == 1u);
    halves[2u * id.x] = part;
    halves[2u * id.x + 1u] = other;
}

// The last part of the list that does not begin after the splat.
@compute @workgroup_size(256)
fn locate(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= halving.most) {
        return;
    }
    var begin = 0u;
    var end = list[0];
    while (end - begin > 1u) {
        let middle = (begin + end) / 2u;
        if (first_splats[middle] <= id.x) {
            begin = middle;
        } else {
            end = middle;
        }
    }
    let part = parts[list[1u + begin]];
    cells[2u * id.x] = part.column;
    cells[2u * id.x + 1u] = part.row;
}
