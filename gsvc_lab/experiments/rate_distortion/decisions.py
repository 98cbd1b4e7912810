"""The first questions of somebody who builds codecs about the comparison, and the answers."""

from typing import Final

DECISIONS: Final = (
    (
        "source",
        "All coders get the same 8-bit 4:2:0 planes, the codecs as they are, GSVC as R′G′B′ made of them. {clips}.",
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
        "with --no-decisions, since what the encoder tells there is no picture either.",
    ),
    (
        "key frames",
        "By their defaults libx264 and libx265 at most 250 frames apart, libsvtav1 some 5 seconds, libvvenc 1 "
        "second, in its PSNR tuning a minute; and at cuts. GSVC only where it finds cuts.",
    ),
    (
        "order and delay",
        "The codecs code B-frames in hierarchies and look tens of frames ahead; GSVC predicts from the frame before"
        " alone. Settings of the codecs for low delay are not in here; they would be nearer to GSVC.",
    ),
    (
        "presets",
        "Defaults of ffmpeg and of the libraries: medium of libx264, libx265 and libvvenc; libsvtav1 has its own, "
        "see below. Slower presets take fewer bits.",
    ),
    (
        "PSNR tuning",
        "libx264 and libx265 -tune psnr (no psychovisual decisions, no adaptive quantisation), libsvtav1 tune=1, "
        "libvvenc -qpa 0. That they took effect is read from what the codec reports.",
    ),
    (
        "scales",
        "CRF 30 to 10 and QP 28 to 18 are the paper's; coarser ones are added so that the curves meet GSVC's. AV1's"
        " CRF is another scale, to 63 instead of 51, and goes from 60 to 10. The paper's AVC, HEVC and AV1 are those "
        "of ffmpeg 5.1, its VVC is VTM 23.6 in random access; here it is libvvenc, which codes 10 bits: its pictures "
        "are rounded to 8.",
    ),
    (
        "BD-rate",
        "Rate over quality, by PCHIP in the logarithm of the rate (package bjontegaard), over the qualities that "
        "both curves reach and no others: where there are none, it says no overlap; * marks less than half of the "
        "test's own range. MS-SSIM counts as −10 log₁₀(1 − MS-SSIM). Points that another point of their curve beats"
        " are left out. Means over clips are geometric, of the ratios of bits.",
    ),
    (
        "seconds",
        "Wall clock. Codecs: from the start of ffmpeg to its end, {start:.2f} s of it for starting; what is decoded"
        " is thrown away. GSVC: in a running process with compiled kernels. Each coder takes as many threads as it "
        "wants unless --threads says otherwise; CPU seconds are in the JSON.",
    ),
    (
        "software",
        "{software}.",
    ),
)
"""Topic and answer; clips, start and software are filled in."""
