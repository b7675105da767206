"""Verdicts as files: a self-contained HTML page, JSON, JUnit XML."""

from atmoref.report.html import Panel, View, page, report_of_check, report_of_compare
from atmoref.report.junit import junit_of_check, junit_of_compare
from atmoref.report.plain import check_json, check_table

__all__ = [
    "Panel",
    "View",
    "check_json",
    "check_table",
    "junit_of_check",
    "junit_of_compare",
    "page",
    "report_of_check",
    "report_of_compare",
]
