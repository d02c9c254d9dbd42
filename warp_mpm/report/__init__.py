"""The report: one HTML page that tells and shows all of a run, or of several side by side, without a network.

write_report([Results.open("runs/set_iib")], Path("report.html"))
"""

from warp_mpm.report.page import write_report as write_report

__all__ = ["write_report"]
