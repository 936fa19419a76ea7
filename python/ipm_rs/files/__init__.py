"""Files of data: written whole or not at all (`atomic`), pictures (`images`), depth (`depth`).

Calibrations are read by `ipm_rs.calibration`, points by `ipm_rs.pointfile`.
"""
