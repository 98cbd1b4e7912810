// binary32 in integers: fl(a + b), fl(a b) and fl(a / b) of spec.md, section 3.3, on bit patterns; and binary16
// (8-5), (8-6).
//
// Where bits have to be the same on every machine, f32 is no help in WGSL: it may fuse a product and a sum, round in
// either direction, flush subnormal numbers to zero and take all numbers for finite, and nothing in the language stops
// it. Integers are exact everywhere. A sum or a product takes about 50 integer operations, a quotient some 200.
//
// This text is put in front of the shaders that need it.

const SIGN = 0x80000000u;
const MAGNITUDE = 0x7fffffffu;
const INFINITY = 0x7f800000u;
const NOT_A_NUMBER = 0x7fc00000u;
const ONE = 0x3f800000u;

fn is_nan(a: u32) -> bool {
    return (a & MAGNITUDE) > INFINITY;
}

// A number significand 2^(exponent - 150). The leading one of a significand is bit 23, which subnormal numbers lack.
struct Unpacked {
    exponent: i32,
    significand: u32,
}

fn unpacked(a: u32) -> Unpacked {
    let field = (a & MAGNITUDE) >> 23u;
    let fraction = a & 0x7fffffu;
    return Unpacked(i32(max(field, 1u)), select(fraction, fraction | 0x800000u, field > 0u));
}

// The same for numbers that are not 0, subnormal ones with smaller exponents instead.
fn normalized(a: u32) -> Unpacked {
    let number = unpacked(a);
    // range: 0 to 23, since the significand is not 0
    let zeros = countLeadingZeros(number.significand) - 8u;
    return Unpacked(number.exponent - i32(zeros), number.significand << zeros);
}

// a / 2^n; the last bit is set if ones were lost, so that rounding still sees on which side of a tie they lay.
// range: n is 1 to 31 in the end
fn shifted_right(a: u32, n: u32) -> u32 {
    if (n == 0u) {
        return a;
    }
    if (n > 31u) {
        return min(a, 1u);
    }
    return (a >> n) | min(a << (32u - n), 1u);
}

// significand 2^(exponent - 158) to nearest, ties to even; the significand is not 0.
fn rounded(sign: u32, exponent: i32, significand: u32) -> u32 {
    let zeros = countLeadingZeros(significand);    // range: 0 to 31
    var leading = significand << zeros;        // a one in bit 31
    var field = exponent - i32(zeros);
    if (field < 1) {                           // subnormal, or 0
        leading = shifted_right(leading, u32(1 - field));
        field = 1;
    }
    var bits = (u32(field - 1) << 23u) + (leading >> 8u);    // the leading one, if it is there, adds the 1 to the field
    let rest = leading & 0xffu;
    if (rest > 0x80u || (rest == 0x80u && (bits & 1u) == 1u)) {
        bits++;                                // may carry into the exponent, as it should
    }
    return sign | min(bits, INFINITY);         // overflow
}

fn add(a: u32, b: u32) -> u32 {
    let large = select(b, a, (a & MAGNITUDE) >= (b & MAGNITUDE));
    let small = select(a, b, (a & MAGNITUDE) >= (b & MAGNITUDE));
    let subtracts = ((a ^ b) & SIGN) != 0u;
    if ((large & MAGNITUDE) >= INFINITY) {
        return select(large, NOT_A_NUMBER, is_nan(large) || ((small & MAGNITUDE) == INFINITY && subtracts));
    }
    let x = unpacked(large);
    let y = unpacked(small);
    // 7 bits after the last one: where a difference loses more than one leading bit, the shift was by at most one.
    let first = x.significand << 7u;
    let second = shifted_right(y.significand << 7u, u32(x.exponent - y.exponent));
    let sum = select(first + second, first - second, subtracts);
    if (sum == 0u) {
        return a & b & SIGN;                   // -0 only for -0 + -0
    }
    return rounded(large & SIGN, x.exponent + 1, sum);
}

fn subtract(a: u32, b: u32) -> u32 {
    return add(a, b ^ SIGN);
}

fn multiply(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & SIGN;
    let p = a & MAGNITUDE;
    let q = b & MAGNITUDE;
    if (max(p, q) >= INFINITY) {
        return select(sign | INFINITY, NOT_A_NUMBER, max(p, q) > INFINITY || min(p, q) == 0u);
    }
    if (min(p, q) == 0u) {
        return sign;
    }
    let x = normalized(a);
    let y = normalized(b);
    // 24 by 24 bits from halves of 12: high 2^24 + middle 2^12 + low, of which 32 bits stay, the last one as in
    // shifted_right.
    let x1 = x.significand >> 12u;
    let x0 = x.significand & 0xfffu;
    let y1 = y.significand >> 12u;
    let y0 = y.significand & 0xfffu;
    let low = x0 * y0;
    let middle = x1 * y0 + x0 * y1 + (low >> 12u);
    let lost = (middle & 0xfu) | (low & 0xfffu);
    let product = ((x1 * y1) << 8u) + (middle >> 4u);    // 2^-16 of it
    return rounded(sign, x.exponent + y.exponent - 126, product | min(lost, 1u));
}

// The divisor is normal and finite here: l11, l22 of splats that are not degenerate, sizes of frames.
fn divide(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & SIGN;
    if ((a & MAGNITUDE) >= INFINITY) {
        return select(sign | INFINITY, NOT_A_NUMBER, is_nan(a));
    }
    if ((a & MAGNITUDE) == 0u) {
        return sign;
    }
    let x = normalized(a);
    let y = normalized(b);
    var remainder = x.significand;
    var quotient = 0u;
    for (var bit = 0u; bit < 31u; bit++) {
        quotient <<= 1u;
        if (remainder >= y.significand) {
            remainder -= y.significand;
            quotient |= 1u;
        }
        remainder <<= 1u;
    }
    return rounded(sign, x.exponent - y.exponent + 127, (quotient << 1u) | min(remainder, 1u));
}

// The integer nearest to a number with two bits after the point, ties to even.
fn nearest(quarters: u32) -> u32 {
    return (quarters + 1u + ((quarters >> 2u) & 1u)) >> 2u;
}

// An integer below 2^24, which is exact.
fn from_integer(value: u32) -> u32 {
    return select(rounded(0u, 158, value), 0u, value == 0u);
}

// (8-5): the binary32 that is equal to a binary16. Infinities are kept.
fn from_half(half: u32) -> u32 {
    let sign = (half & 0x8000u) << 16u;
    let exponent = (half >> 10u) & 31u;
    let fraction = half & 0x3ffu;
    if (exponent == 31u) {
        return sign | INFINITY | (fraction << 13u);
    }
    if (exponent > 0u) {
        return sign | ((exponent + 112u) << 23u) | (fraction << 13u);
    }
    if (fraction == 0u) {
        return sign;
    }
    return rounded(sign, 134, fraction);       // F 2^-24
}

// (8-6), for what rounds to a finite number: to nearest, ties to even.
fn to_half(value: u32) -> u32 {
    let number = unpacked(value);              // significand 2^(exponent - 150)
    let exponent = max(number.exponent - 127, -14);
    // k = |v| 2^(10 - n) = significand 2^(exponent - 140 - n), at least 13 places to the right
    let shift = u32(140 + exponent - number.exponent);
    let steps = nearest(shifted_right(number.significand, shift - 2u));
    return ((value >> 16u) & 0x8000u) + (u32(exponent + 14) << 10u) + steps;
}
