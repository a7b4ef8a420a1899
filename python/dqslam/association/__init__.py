"""Association: which boxes show the same object."""

from dqslam.association.all_images import FinalEstimate as FinalEstimate
from dqslam.association.all_images import estimate_all_images as estimate_all_images
from dqslam.association.association import FINAL as FINAL
from dqslam.association.association import UNSURE as UNSURE
from dqslam.association.association import Association as Association
from dqslam.association.association import associate as associate
from dqslam.association.association import not_found as not_found
from dqslam.association.gating import CHI2_GATE as CHI2_GATE
from dqslam.association.rays import cameras_by_odometry as cameras_by_odometry
from dqslam.association.rays import cast_rays as cast_rays
from dqslam.association.repetition import RepeatedNoise as RepeatedNoise
from dqslam.association.thinning import fill_in as fill_in
from dqslam.association.tracklets import link_tracklets as link_tracklets
