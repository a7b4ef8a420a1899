"""The settings of a detector and of the tracker that gives its boxes ids."""

from typing import Annotated, Literal

from pydantic import Field

from dqslam.simulation.scenario.settings import Count, NotNegative, Settings, Share

WrongAssociationKind = Literal["random", "structured"]
FalseBoxIds = Literal["known", "own"]


class DetectorSettings(Settings):
    """The boxes of a detector: when an object gets one, its noise, and its id."""

    min_side_px: NotNegative
    """An object is detected when the longer side of its box exceeds this."""
    edge_sigma_px: NotNegative
    truncation: Literal["discard", "clip"] = "discard"
    """Whether a box that leaves the image is discarded, or clipped to the part inside."""
    min_visible_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """With "clip": the least share of the whole box's area that must be inside of the image."""
    occlusion_max_hidden: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    """Whether nearer objects hide farther ones: a box then bounds the part of the outline that is
    seen, and nothing marks it; an object of which more than this share is hidden has no box."""
    missing_boxes: Share = 0.0
    """Share of the boxes that the detector misses."""

    edge_tail_dof: Annotated[float, Field(gt=2.0)] | None = None
    """Degrees of freedom of a Student t distribution of the noise, with the scale edge_sigma_px;
    without it the noise is Gaussian."""
    edge_bias_px: float = 0.0
    """Every edge is off by this, outwards."""
    whole_pixels: bool = False
    """Whether edges are rounded to whole pixels, counted from the corner of the image."""

    wrong_associations: Annotated[float, Field(ge=0.0, le=0.4)] = 0.0
    """Share of the boxes that carry the id of another detected object."""
    wrong_association_kind: WrongAssociationKind = "random"
    """Which other object: any ("random"), or the one with the nearest center ("structured")."""
    burst_share: Share = 0.0
    """Share of the boxes that carry the id of another detected object for a run of boxes in a row,
    as a tracker switches ids."""
    burst_length: Count = 15
    """Boxes of an object in such a run."""
    false_boxes: Share = 0.0
    """Share of the boxes that show no object; they are at random places of the image."""
    false_box_ids: FalseBoxIds = "known"
    """Whether a false box carries the id of a detected object that has no box in the same image,
    or an id that no other box has."""

    @property
    def edge_rms_px(self) -> float:
        """Return the root mean square error of an edge, pixels."""
        dof = self.edge_tail_dof
        widening = 1.0 if dof is None else dof / (dof - 2.0)
        rounding = 1.0 / 12.0 if self.whole_pixels else 0.0
        variance = self.edge_sigma_px**2 * widening + rounding + self.edge_bias_px**2
        return float(variance**0.5)

    @property
    def shows_wrong_objects(self) -> bool:
        """Return whether some boxes do not show the object whose id they carry."""
        return max(self.wrong_associations, self.burst_share, self.false_boxes) > 0.0
