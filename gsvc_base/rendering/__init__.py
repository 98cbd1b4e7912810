"""The picture of splats in binary64 (`definition`), and how far a binary32 renderer may be from it (`bounds`)."""
