"""gsvc_tools: what makes the codec gsvc_ref pleasant to use, a plug-in of the same distribution.

gsvc_ref has what a decoder, the paper's training, or one readable encoder needs. What people want beside that stands
here: commands and functions that gsvc_ref offers under its own names when this package is installed, registered below
through `gsvc_ref.plugins`. It imports gsvc_ref; gsvc_ref imports nothing from here.
"""
