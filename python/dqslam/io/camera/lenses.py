"""The names of lens models, and lists of their coefficients, as camera files have them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from dqslam.lens import PARAMETERS, Lens

# What the name of a model, without punctuation, is searched for, and its family; None is unknown.
_FAMILIES = (
    ("thinprismfisheye", "thin_prism_fisheye"),
    (
        "omni(?!vision)|^mei$|scaramuzza|ocam|doublesphere|division|inversebrown|ucm|unified|spheri|equirect"
        "|panoram|cylind|^(pinhole)?ds$",
        None,
    ),
    ("equidist|equi$|fisheye|kannala|^kb[48]?$", "equidistant"),
    ("fov|^atan|ftheta", "fov"),
    ("^(distortion)?none$|^nodistortion$|^ideal$|^rectified$|^undistorted$", "none"),
    ("plumbbob|radtan|tangential|brown|rational|opencv|radial|thinprism|polynomial", "polynomial"),
    ("pinhole|perspective", "pinhole"),
)
# OpenCV's lists: 4 numbers lack k3, 14 end with the tilt of the sensor.
_LENGTHS = {4: "plumb_bob", 5: "plumb_bob", 8: "rational", 12: "thin_prism", 14: "thin_prism"}
_POLYNOMIAL = PARAMETERS["thin_prism"]
COEFFICIENTS = (*_POLYNOMIAL, "omega", "sx1", "sy1")
IDEAL = Lens("plumb_bob", (0.0,) * 5)


def plain(name: str) -> str:
    """Return a name in lower case, without punctuation: Dist_Coeffs and distCoeffs are one."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def lens_family(name: str) -> str | None:
    """Return the family of a model by its name, or None for a name of no model.

    Families are none, polynomial, equidistant, fov, thin_prism_fisheye, and pinhole, which leaves
    open whether a lens bends its image.

    Raises
    ------
    ValueError
        If the model is known to be of another kind, such as an omnidirectional one.
    """
    word = plain(name)
    for pattern, family in _FAMILIES:
        if re.search(pattern, word):
            if family is None:
                known = ", ".join(("pinhole", *PARAMETERS))
                raise ValueError(f"the lens model is {name}; only {known} are known")
            return family
    return None


def lens_of_list(family: str, values: Sequence[float]) -> Lens:
    """Return the lens of a list of coefficients, in the order of its family.

    Raises
    ------
    ValueError
        If the family has no list of this length, or one of its numbers is of no model here.
    """
    if family == "none":
        if any(values):
            raise ValueError("the model has no distortion, but coefficients are not zero")
        return IDEAL
    if family == "equidistant":
        # Drivers pad the four numbers with zeros.
        if len(values) < 4 or any(values[4:]):
            raise ValueError(f"{len(values)} numbers, not the 4 of the model equidistant")
        return Lens("equidistant", tuple(values[:4]))
    if family == "fov":
        if not values or any(values[1:]):
            raise ValueError(f"{len(values)} numbers, not the one of the model fov")
        return Lens("fov", (values[0],))
    if family == "thin_prism_fisheye":
        return Lens("thin_prism_fisheye", tuple(values))
    if not values:
        return IDEAL
    if len(values) not in _LENGTHS:
        raise ValueError("is not a list of 4, 5, 8, 12 or 14 numbers: k1 k2 p1 p2 k3 ...")
    if any(values[12:]):
        raise ValueError("tau_x and tau_y, the tilt of the sensor, are not known")
    return polynomial([*values[:12], *[0.0] * 12][:12])


def lens_of_names(family: str | None, given: Mapping[str, float]) -> Lens:
    """Return the lens of coefficients by their names, of COEFFICIENTS.

    Raises
    ------
    ValueError
        If a coefficient is of another model, or if they leave open of which model they are.
    """
    is_open = family in (None, "pinhole")
    if is_open and given.get("k4") and not ({"p1", "p2", "k5", "k6"} & set(given)):
        raise ValueError(
            "k1 k2 k3 k4 without p1 p2 may be of two models; add a model: equidistant or rational"
        )
    names = () if family == "none" else PARAMETERS.get(family or "", _POLYNOMIAL)
    other = [name for name in given if name not in names and given[name]]
    if other:
        raise ValueError(f"{other[0]} is no coefficient of the model {family or 'rational'}")
    values = [given.get(name, 0.0) for name in names]
    return polynomial(values) if names == _POLYNOMIAL else lens_of_list(family or "none", values)


def polynomial(values: Sequence[float]) -> Lens:
    """Return the smallest model that has all of k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4."""
    if any(values[8:]):
        return Lens("thin_prism", tuple(values))
    if any(values[5:]):
        return Lens("rational", tuple(values[:8]))
    return Lens("plumb_bob", tuple(values[:5]))
