"""Where a camera is in a map, from the boxes of its images."""

from dqslam.places.location.location import Candidate as Candidate
from dqslam.places.location.location import Location as Location
from dqslam.places.location.location import locate as locate
from dqslam.places.location.place_map import PlaceMap as PlaceMap
