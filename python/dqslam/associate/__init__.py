"""Association: which boxes show the same object."""

from dqslam.associate.association import FINAL as FINAL
from dqslam.associate.association import UNSURE as UNSURE
from dqslam.associate.association import Association as Association
from dqslam.associate.association import associate as associate
from dqslam.associate.association import not_found as not_found
from dqslam.associate.gating import CHI2_GATE as CHI2_GATE
from dqslam.associate.gating import box_chi2 as box_chi2
from dqslam.associate.rays import cameras_by_odometry as cameras_by_odometry
from dqslam.associate.rays import cast_rays as cast_rays
from dqslam.associate.thinning import fill_in as fill_in
from dqslam.associate.tracklets import link_tracklets as link_tracklets
