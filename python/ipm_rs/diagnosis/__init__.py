"""What is wrong with a calibration, or right: `doctor`, which `ipm_rs.doctor` is, and its reports.

report = ipm_rs.doctor(camera, grid, image=image)
print(report)
report.draw().save("report.png")
"""

from ipm_rs.diagnosis._coverage import REASONS, FarEnd
from ipm_rs.diagnosis._doctor import doctor
from ipm_rs.diagnosis._findings import Finding
from ipm_rs.diagnosis._report import Report
from ipm_rs.diagnosis._ring import RigReport

__all__ = ["REASONS", "FarEnd", "Finding", "Report", "RigReport", "doctor"]
