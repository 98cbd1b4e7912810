"""The loss of training in decibels, and back."""

import math

from gsvc_base.portable import log10, power


def psnr_of_loss(loss: float) -> float:
    """PSNR in dB of a loss (10-1), which is three times the mean squared error; infinite for 0."""
    return 10 * float(log10(3 / loss)) if loss > 0 else math.inf


def loss_of_psnr(psnr: float) -> float:
    """The loss (10-1) of a PSNR in dB."""
    return 3 * float(power(10.0, -psnr / 10))
