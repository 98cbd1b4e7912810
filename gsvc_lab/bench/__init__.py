"""GSVC and the codecs of one ffmpeg program on the same clip: rate, distortion, seconds, BD-rates."""
