"""What has changed between two maps of one place."""

from dqslam.places.changes.comparison import STATUSES as STATUSES
from dqslam.places.changes.comparison import Change as Change
from dqslam.places.changes.comparison import Changes as Changes
from dqslam.places.changes.comparison import changes as changes
from dqslam.places.changes.files import read_changes as read_changes
