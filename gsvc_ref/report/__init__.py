"""One self-contained HTML page about one encoding: pictures, quality, bits and time."""

from gsvc_ref.report.data import Choice, Figure, FrameRecord, PictureRow, ReportData
from gsvc_ref.report.page import report_html, write_report
from gsvc_ref.report.pictures import difference_picture, splat_centres_picture

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
