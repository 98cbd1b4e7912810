"""One self-contained HTML page about one encoding: pictures, quality, bits and time."""

from gsvc_lab.pages.data import Choice, Figure, FrameRecord, PictureRow, ReportData
from gsvc_lab.pages.page import report_html, write_report
from gsvc_lab.pages.pictures import difference_picture, splat_centres_picture

__all__ = [
    "Choice",
    "Figure",
    "FrameRecord",
    "PictureRow",
    "ReportData",
    "difference_picture",
    "report_html",
    "splat_centres_picture",
    "write_report",
]
