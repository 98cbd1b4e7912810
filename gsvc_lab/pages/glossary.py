"""The words of the pages about encodings, explained for people who have a video and have not read the paper."""

import html
from collections.abc import Sequence
from typing import Final

WORDS: Final = {
    "GSVC": (
        "Gaussian splats for video compression: a video as splats that are learned frame by frame, predicted from "
        "the frame before, and coded."
    ),
    "splat": (
        "A soft elliptic spot: a place, a size, a shape and a colour. The sum of all splats of a frame is its picture."
    ),
    "I-frame": "A key frame: a frame that is coded on its own, so that decoding can begin there.",
    "P-frame": (
        "A frame that is predicted: the splats of the frame before, moved and changed, some gone and some new."
    ),
    "R-frame": "A frame that repeats the one before; it costs a few bytes.",
    "GOP": "Group of pictures: an I-frame and the frames up to the next one. It can be decoded without the others.",
    "PSNR": (
        "Peak signal-to-noise ratio in decibels, from the mean squared difference of the decoded and the original "
        "samples. Some 30 dB show clear traces, 35 dB are good, at 40 dB it is hard to see a difference; 3 dB more "
        "halve the squared error."
    ),
    "MS-SSIM": (
        "Structural similarity on several scales, 0 to 1: compares contrast and structure as an eye would, rather "
        "than samples."
    ),
    "VMAF": (
        "A score from 0 to 100 that was trained on what people say of videos; some 90 and more count as excellent."
    ),
    "bits/pixel": "Bits of the file for each pixel of all frames; a raw video of 8 bits has 24.",
    "layer": (
        "A file may hold several qualities: a base that can be decoded alone, and layers that each add splats to it."
    ),
    "frames (effect)": "Whether the frame is optimised at all, or repeats the one before since nothing changed.",
    "regions": "Whether all splats are optimised, or those over unchanged regions stay as they are.",
    "GSA": "Gaussian splat augmentation: splats added to a P-frame where the prediction is wrong.",
    "GSP": "Gaussian splat pruning: splats removed that are worth less than their bits.",
    "DKS": (
        "Dynamic key-frame selection: a frame is trained twice, from scratch and from the frame before; where the "
        "first is much better there is a cut, and the frame becomes an I-frame."
    ),
    "motion": (
        "Splats that are moved along the optical flow before a P-frame is fitted; as bits, those that tell how."
    ),
    "steps": "Optimisation steps: how often all splats of the frame were changed a little for the better.",
    "cells, luma, chroma, size, aspect, shear, place": (
        "Bits of the splats of I-frames (profile main): how many lie in each cell of the frame and where in it, "
        "their colours, and their shapes."
    ),
    "modes, position, shape, color": ("Bits of the splats of P-frames (profile main): which of them change, and what."),
    "densities, entropy_coder": (
        "Bits that tell the decoder how frequent each value is, and what the coder rounds up."
    ),
    "positions, cholesky, colors, codebooks": (
        "Bits of profile paper: places, shapes, colours, and the tables that the colours are numbers of."
    ),
    "container, header, frame_header, index, end": (
        "What a file needs beside its splats: names and lengths of its parts, size and frame rate, and where each "
        "I-frame begins."
    ),
    "checksums": "Bits that let a decoder find out that splats are damaged.",
    "ancillary": "What pictures do not need, such as the log of the encoder’s decisions.",
    "unread, skipped": "Bits at and after damage, which cannot be believed.",
    "x264": (
        "A widely used encoder of H.264 (AVC). Slow is its preset of that name. With I and P only it predicts from "
        "past frames as GSVC does; by default it also has B-frames, which are predicted from both sides."
    ),
    "CRF": "Constant rate factor: the number that sets the quality of x264, x265 and SVT-AV1; less is better.",
    "QP": "Quantiser parameter: the number that sets the quality of vvenc here; less is better.",
    "N": "The number of splats that a frame may have, by which the quality of GSVC is set here.",
    "BD-rate": (
        "Bjøntegaard delta rate: how many more bits (+) or fewer (−) one coder takes than another at equal quality, "
        "on average over the qualities that both reach."
    ),
}
"""Each word with its meaning; several words that belong together stand with commas between."""


def glossary(words: Sequence[str]) -> str:
    """The words with their meanings, folded up."""
    entries = "".join(f"<dt>{html.escape(word)}</dt><dd>{html.escape(WORDS[word])}</dd>" for word in words)
    return f'<details class="glossary"><summary>What the words on this page mean</summary><dl>{entries}</dl></details>'
