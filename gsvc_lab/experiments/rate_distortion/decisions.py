"""The first questions of somebody who builds codecs about the comparison, and the answers; and why `main` loses."""

from typing import Final

DECISIONS: Final = (
    (
        "source",
        "All coders get the same 8-bit 4:2:0 planes, the codecs as they are, GSVC as R′G′B′ 4:4:4 made of them. So no "
        "coder loses by 4:2:0, and codecs in 4:4:4, which would code chroma samples that were interpolated, are not "
        "in here. {clips}.",
    ),
    (
        "quality",
        "Decoded planes become R′G′B′ by that same conversion (the clip's matrix, chroma interpolated linearly). "
        "PSNR and MS-SSIM are of 8-bit R′G′B′, all three components; PSNR is the mean of the frames' dB, MS-SSIM of "
        "the frames' values. VMAF is model v0.6.1, on "
        "BT.709 luma made of it. GSVC minimises the error of R′G′B′, codecs that of Y′CbCr with most weight on "
        "luma. So PSNR of Y′ stands beside; GSVC's is of its R′G′B′ turned back to 4:2:0.",
    ),
    (
        "small pictures",
        "MS-SSIM has all its five scales from 161 samples on the shorter side; where there are fewer, a note says "
        "so. VMAF's model was made for 1920x1080.",
    ),
    (
        "bits",
        "Bare streams. AVC and HEVC: without the SEI in which x264 and x265 write their options, up to more than "
        "half of the shortest streams here; VVC: without access unit delimiters; AV1: low-overhead OBUs with a "
        "temporal delimiter of 2 bytes a frame. GSVC: the whole file with header, checksums and index, made "
        "with --no-decisions, since the log of decisions is not part of the picture.",
    ),
    (
        "settings",
        "One rule for all clips: the preset as it is, seed 0, and N by the area of the picture: one splat for 200, 100,"
        " 50 and 25 pixels; main's quick has 400 and 12 as well, since its splats take about a quarter of the bits and "
        "on plain pictures few of them are as good as many of paper's. Paper's quick with 600 iterations, which takes "
        "long, has 100, 50 and 25, and every frame alone 100 and 25. Nothing was chosen by clip.",
    ),
    (
        "600 iterations",
        "Profile paper, quick, with 600 iterations an I-frame in place of 150 and P-frames in proportion. The paper's "
        "own schedule (preset paper: 50,000 iterations at the rate 0.001 from a random start) has after 600 iterations "
        "no picture yet; --full makes it on few frames.",
    ),
    (
        "key frames",
        "By these settings libx264 and libx265 at most 250 frames apart, libsvtav1 some 5 seconds, libvvenc a minute, "
        "and at cuts. GSVC only where it finds cuts.",
    ),
    (
        "order and delay",
        "The codecs code B-frames in hierarchies and look tens of frames ahead; GSVC predicts from the frame before"
        " alone, as x264 does with I- and P-frames only, which still looks ahead.",
    ),
    (
        "presets",
        "libx264 and libx265 slow, libsvtav1 4, libvvenc medium. Tuned for PSNR (libx264 and libx265 -tune psnr, "
        "libsvtav1 tune=1, libvvenc -qpa 0) but for one row, psychovisual, which is x264's slow as it is. That "
        "options took effect is read from what the codec reports. A chroma QP lower by 5 is about the best for PSNR of "
        "R′G′B′, to which chroma counts more than to that of Y′CbCr.",
    ),
    (
        "scales",
        "CRF 30 to 10 and QP 28 to 18 are the paper's; coarser ones are added so that the curves meet GSVC's. AV1's"
        " CRF is another scale, to 63 instead of 51, and goes from 60 to 10. The paper's AVC, HEVC and AV1 are those "
        "of ffmpeg 5.1, its VVC is VTM 23.6 in random access; here it is libvvenc, which codes 10 bits: its pictures "
        "are rounded to 8.",
    ),
    (
        "ideal code length",
        "As the design of main counts it: code lengths of all symbols by the distributions of 14 bits that a decoder "
        "has, the densities that are sent, and 112 bits an I-frame and 88 a P-frame for container, header and the end "
        "of the coder. The file has all that it has: sequence header, index and end, too.",
    ),
    (
        "BD-rate",
        "Rate over quality, by PCHIP in the logarithm of the rate (SciPy), over the qualities that "
        "both curves reach and no others: where there are none, it says no overlap; * marks less than half of the "
        "test's own range, and a mean with one such or none. MS-SSIM counts as −10 log₁₀(1 − MS-SSIM). Points that "
        "another point of their curve beats are left out. Means over clips are geometric, of the ratios of bits.",
    ),
    (
        "seconds",
        "Wall clock. Codecs: from the start of ffmpeg to its end, {start:.2f} s of it for starting; what is decoded"
        " is thrown away. GSVC: in a running process with compiled kernels, its coders in turns. Each coder takes as "
        "many threads as it wants unless --threads says otherwise; CPU seconds are in the JSON.",
    ),
    (
        "software",
        "{software}.",
    ),
)
"""Topic and answer; clips, start and software are filled in."""

WHY: Final = (
    (
        "a camera pans, or things enter at a border",
        "A picture of splats is black where no splat comes in. A video codec repeats the pixels of the edge and codes "
        "separate blocks there; main needs new splats, which cost as much as those of an I-frame. In the design's "
        "measurements the entering 3 to 4.5 % of a pan's area held 36 to 45 % of the prediction's error.",
    ),
    (
        "things move fast past each other",
        "Better vectors did not help: moved by those of an exhaustive search the splats predict no better. A guess, "
        "not isolated: large splats overlap and cancel each other across the edge between two motions, and leave "
        "an error when they are moved apart; blocks of pixels do not.",
    ),
    (
        "texture and noise fill the picture",
        "A splat is a smooth bump: fine texture needs one for a few pixels, with eight parameters each. A transform of "
        "a block describes the same texture by few numbers. Noise cannot be predicted by either.",
    ),
    (
        "codecs with B-frames",
        "They take the mean of two predictions, which sums of splats have no form for; frames in another order alone "
        "took 2 to 12 % more bits on a head. What B-frames are worth to x264 is the difference of its two rows.",
    ),
    (
        "high quality",
        "More splats overlap more, and each has to be fitted to the others' errors: bits rise faster with PSNR than a "
        "codec's. main is nearest to codecs at low rates.",
    ),
)
"""Where `main` takes more bits than video codecs, and why."""
