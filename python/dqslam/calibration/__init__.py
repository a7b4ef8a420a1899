"""What boxes say about camera, mount and odometry: tests, estimation, and its uncertainty."""

from dqslam.calibration.check import check_calibration as check_calibration
from dqslam.calibration.clock import ClockError as ClockError
from dqslam.calibration.clock import find_clock_error as find_clock_error
from dqslam.calibration.clock import scale_and_offset as scale_and_offset
from dqslam.calibration.covariances import Sensitivity as Sensitivity
from dqslam.calibration.covariances import calibrated_covariances as calibrated_covariances
from dqslam.calibration.covariances import sensitivity as sensitivity
from dqslam.calibration.delay import are_late as are_late
from dqslam.calibration.delay import one_sided as one_sided
from dqslam.calibration.delay import scores_at as scores_at
from dqslam.calibration.joint import are_scales as are_scales
from dqslam.calibration.joint import combined as combined
from dqslam.calibration.joint import solve_jointly as solve_jointly
from dqslam.calibration.joint import solve_with_calibration as solve_with_calibration
from dqslam.calibration.parameters import CalibrationFinding as CalibrationFinding
from dqslam.calibration.parameters import calibration_parameters as calibration_parameters
from dqslam.calibration.parameters import parameter_rows as parameter_rows
from dqslam.calibration.recalibrate import recalibrate as recalibrate
