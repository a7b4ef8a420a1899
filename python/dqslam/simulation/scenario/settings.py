"""What the sections of a scenario have in common.

Settings are only in the file; a setting with a default is off by default. Names include the unit.
"""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]
# A larger number is a slip: what it asks for would fill the memory.
MOST = 1_000_000
MOST_POSES = 10 * MOST
Count = Annotated[int, Field(ge=1, le=MOST)]


class Settings(BaseModel):
    """Settings that refuse unknown keys and infinity, and do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
